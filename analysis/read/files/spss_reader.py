"""The process that opens an SPSS file: native code reads it, which damaged bytes may kill.

python -m analysis.read.files.spss_reader FILE

Takes names of variables as a JSON list on its standard input and prints JSON: `names` of all variables,
`columns` and `labels` of those named, or `refused` with the reason.
"""

import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis.read.files.cells import cell_text

SPARE_BYTES, BYTES_PER_BYTE = 4 << 30, 64
"""Memory for any file, and for each of its bytes: damaged lengths may ask for any amount."""


def main(path: Path) -> None:
    """Print what a file holds as JSON."""
    _bound_memory(path.stat().st_size)
    sys.stdout.write(json.dumps(_read(path, json.load(sys.stdin))))


def _bound_memory(size: int) -> None:
    try:
        import resource  # absent on Windows
    except ImportError:
        return
    limit = SPARE_BYTES + BYTES_PER_BYTE * size
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))


def _read(path: Path, names: list[str]) -> dict[str, Any]:
    import pyreadstat

    try:
        columns, about = pyreadstat.read_sav(path, metadataonly=not names, output_format="dict")
    except Exception as error:  # of damaged files pyreadstat raises whatever it stumbles over
        return {"refused": " ".join(str(error).split()) or type(error).__name__}
    if not all(about.column_names):
        return {"refused": "a variable has no name"}
    labels: Mapping[str, Mapping[Any, Any]] = about.variable_value_labels
    return {
        "names": list(about.column_names),
        "columns": {name: [_plain(value) for value in columns[name]] for name in names},
        "labels": {
            name: [[cell_text(code), str(word)] for code, word in _ordered(labels[name])]
            for name in names
            if name in labels
        },
    }


def _ordered(words: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """Codes with their words in the order of the codes, as SPSS lists them."""
    numbers = all(isinstance(code, int | float) for code in words)
    return sorted(words.items(), key=(lambda item: item[0]) if numbers else (lambda item: str(item[0])))


def _plain(value: Any) -> Any:
    """A number as it is; no value as null; anything else as its text."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if math.isfinite(value) else None
    return cell_text(value) or None


if __name__ == "__main__":
    main(Path(sys.argv[1]))
