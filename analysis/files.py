"""Output that is whole or absent: written under a temporary name beside the target, then renamed."""

import json
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from experiments.errors import InputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; rename it if the block ends well, remove it if not."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")
    if path.is_dir():
        raise InputError(f"{path}: expected a file name, this is a folder")
    temporary = path.parent / f".{path.name}.{os.getpid()}.part{path.suffix}"
    try:
        yield temporary
        temporary.replace(path)
    except PermissionError as error:
        raise InputError(f"{path}: the folder {path.parent} cannot be written to") from error
    finally:
        temporary.unlink(missing_ok=True)


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
