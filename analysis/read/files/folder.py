"""Folders of tables as one table: a file a person, as programs for experiments save them, or Psych-DS.

Source: Psych-DS 1.0, https://psych-ds.github.io (data files are `data/**/keyword-value_..._data.csv`, and the
keywords of a file's name are columns). Of any other folder the files `*.csv` in it are read, and the name of
the file without its ending is a column `file` (decision 0910).
"""

from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.read.files.cells import Cells
from analysis.read.files.delimited import delimited_cells, delimited_header
from experiments.errors import InputError

DESCRIPTION = "dataset_description.json"
NAMED_FILES = 5


def header(folder: Path) -> list[str]:
    """Columns that every data file has, and those of the files' names."""
    columns = [[*delimited_header(path)[0], *names_of(folder, path)] for path in data_files(folder)[0]]
    return [name for name in dict.fromkeys(columns[0]) if all(name in names for names in columns)]


def cells(folder: Path, names: list[str]) -> Cells:
    """The columns `names` of all data files, one below the other."""
    files, without_rows = data_files(folder)
    _refuse_joined(files)
    parts = [_part(folder, path, names) for path in files]
    sort = "Psych-DS folder" if _is_psych_ds(folder) else "folder"
    said = [f"read {len(files)} data file{'s' if len(files) > 1 else ''} of the {sort} {folder.name}"]
    if without_rows:
        said.append(f"files without rows left out: {_listed(without_rows)}")
    if copies := _copies(files):
        said.append(f"files that are like another, byte for byte, count too: {_listed(copies)}")
    said += _contradictions(folder, files, parts, names)
    return Cells(
        pd.concat([part.rows for part in parts], ignore_index=True),
        tuple(header(folder)),
        np.concatenate([part.lines for part in parts]),
        decisions=tuple(said),
    )


def names_of(folder: Path, path: Path) -> dict[str, str]:
    """Columns in a file's name: of `study-1_session-2_data.csv` in Psych-DS {study: 1, session: 2}."""
    if not _is_psych_ds(folder):
        return {"file": path.stem}
    parts = (part.partition("-") for part in path.stem.removesuffix("_data").split("_"))
    return {key: value for key, dash, value in parts if dash}


def data_files(folder: Path) -> tuple[list[Path], list[Path]]:
    """The data files of the folder that have rows, in the order of their names, and those that have none."""
    if _is_psych_ds(folder):
        files = sorted((folder / "data").rglob("*_data.csv"))
        expected = "data/..._data.csv in a Psych-DS folder"
    else:
        files = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".csv")
        expected = f"files .csv, one a person, or a Psych-DS folder ({DESCRIPTION})"
    if not files:
        raise InputError(f"{folder.name} is a folder without data files; expected {expected}")
    filled = [path for path in files if _has_rows(path)]
    if not filled:
        raise InputError(f"no data file of the folder {folder.name} has rows")
    return filled, [path for path in files if path not in filled]


def _is_psych_ds(folder: Path) -> bool:
    return (folder / DESCRIPTION).is_file()


def _has_rows(path: Path) -> bool:
    """Whether anything stands below the first line: of runs broken off programs write empty files."""
    with path.open("rb") as file:
        lines = (line for line in file.read().splitlines() if line.strip(b"\r\n\t ,;"))
        return next(lines, None) is not None and next(lines, None) is not None


def _refuse_joined(files: Sequence[Path]) -> None:
    """Refuse a file into which others of the folder were joined: each of their rows would count twice."""
    rows = {path: Counter(path.read_bytes().splitlines()[1:]) for path in files}
    largest = max(files, key=lambda path: rows[path].total())
    inside = [path for path in files if path != largest and rows[path] <= rows[largest]]
    # answers of few kinds are alike by chance, but not as many of them as others have together
    if len(inside) > 1 and sum(rows[path].total() for path in inside) == rows[largest].total():
        raise InputError(
            f"every row of {len(inside)} files ({_listed(inside)}) stands in {largest.name} too and would "
            "count twice; move that file, or the others, out of the folder"
        )


def _copies(files: Sequence[Path]) -> list[Path]:
    """Files whose bytes are those of a file before them."""
    seen: set[bytes] = set()
    copies = []
    for path in files:
        digest = sha256(path.read_bytes()).digest()
        if digest in seen:
            copies.append(path)
        seen.add(digest)
    return copies


def _contradictions(
    folder: Path, files: Sequence[Path], parts: Sequence[Cells], names: Sequence[str]
) -> list[str]:
    """Say it where a column has another value than the name of the file it stands in."""
    for path, part in zip(files, parts, strict=True):
        for name, value in names_of(folder, path).items():
            own = part.rows[name].iloc[0] if name in names else value
            if own != value:
                return [f"'{name}' is {own} in {path.name}; the column counts, not the name of the file"]
    return []


def _listed(files: Sequence[Path]) -> str:
    rest = len(files) - NAMED_FILES
    return f"{', '.join(path.name for path in files[:NAMED_FILES])}{f' and {rest} more' if rest > 0 else ''}"


def _part(folder: Path, path: Path, names: list[str]) -> Cells:
    own, beside = delimited_header(path)[0], names_of(folder, path)
    there = delimited_cells(path, [name for name in names if name in own])
    extra = {name: beside[name] for name in names if name not in own}
    return Cells(there.rows.assign(**extra)[names], there.header, there.lines)
