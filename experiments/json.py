"""JSON of numbers: what is undefined or infinite becomes null."""

import json
import math
from typing import Any


def json_text(value: Any) -> str:
    """Indented JSON; JSON has no NaN, so what is undefined or infinite becomes null.

    Parameters
    ----------
    value : Any
        Dictionaries, lists, tuples, text, numbers and None, in any depth.

    Returns
    -------
    str
        The same text for the same value, ending in a line break.
    """
    return json.dumps(_finite(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
