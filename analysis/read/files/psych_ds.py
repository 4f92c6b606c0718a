"""Psych-DS folders: their data files as one table, the keywords of each file's name as columns beside.

Source: Psych-DS 1.0, https://psych-ds.github.io (data files are `data/**/keyword-value_..._data.csv`).
"""

from pathlib import Path

import numpy as np
import pandas as pd

from analysis.read.files.cells import Cells
from analysis.read.files.delimited import delimited_cells, delimited_header
from experiments.errors import InputError

DESCRIPTION = "dataset_description.json"


def header(folder: Path) -> list[str]:
    """Columns that every data file has, and the keywords of the files' names."""
    columns = [[*delimited_header(path)[0], *keywords(path)] for path in data_files(folder)]
    return [name for name in dict.fromkeys(columns[0]) if all(name in names for names in columns)]


def cells(folder: Path, names: list[str]) -> Cells:
    """The columns `names` of all data files, one below the other."""
    files = data_files(folder)
    parts = [_part(path, names) for path in files]
    said = f"read {len(files)} data file{'s' if len(files) > 1 else ''} of the Psych-DS folder {folder.name}"
    return Cells(
        pd.concat([part.rows for part in parts], ignore_index=True),
        tuple(header(folder)),
        np.concatenate([part.lines for part in parts]),
        decisions=(said,),
    )


def keywords(path: Path) -> dict[str, str]:
    """`study-1_session-2_data.csv` as {study: 1, session: 2}."""
    parts = (part.partition("-") for part in path.stem.removesuffix("_data").split("_"))
    return {key: value for key, dash, value in parts if dash}


def data_files(folder: Path) -> list[Path]:
    """The data files of the folder, in the order of their names."""
    if not (folder / DESCRIPTION).is_file():
        raise InputError(f"{folder} is a folder; expected a CSV file, or a Psych-DS folder ({DESCRIPTION})")
    files = sorted((folder / "data").rglob("*_data.csv"))
    if not files:
        raise InputError(f"{folder.name} has no data file; expected data/..._data.csv in a Psych-DS folder")
    return files


def _part(path: Path, names: list[str]) -> Cells:
    own, beside = delimited_header(path)[0], keywords(path)
    there = delimited_cells(path, [name for name in names if name in own])
    extra = {name: beside[name] for name in names if name not in own}
    return Cells(there.rows.assign(**extra)[names], there.header, there.lines)
