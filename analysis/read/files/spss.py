"""SPSS files (.sav): values as codes, with the words for them beside."""

from pathlib import Path
from typing import Any

from analysis.read.files.cells import Cells, cell_text, cells_of
from experiments.errors import InputError


def header(path: Path) -> list[str]:
    """Names of the variables."""
    return list(_read(path, metadataonly=True)[1].column_names)


def cells(path: Path, names: list[str]) -> Cells:
    """The variables `names`; what is declared missing becomes empty."""
    frame, about = _read(path)
    columns = list(about.column_names)
    labels = {
        name: {cell_text(code): str(word) for code, word in words.items()}
        for name, words in about.variable_value_labels.items()
    }
    return cells_of(columns, frame.to_numpy(dtype=object).tolist(), names, 1, labels=labels)


def _read(path: Path, **options: Any) -> tuple[Any, Any]:
    import pyreadstat

    try:
        frame, about = pyreadstat.read_sav(path, **options)
    except (pyreadstat.ReadstatError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not an SPSS file ({error}); export it as CSV") from error
    if not about.column_names:
        raise InputError(f"{path.name} has no variables")
    return frame, about
