"""Folders of tables as one table: one file per person, as programs for experiments save them, or Psych-DS.

Source: Psych-DS 1.0, https://psych-ds.github.io (data files are `data/**/keyword-value_..._data.csv`, and the
keywords of a file's name are columns). Of any other folder the files `*.csv` in it are read, and the name of
the file without its ending is a column `file`.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.errors import InputError
from table_files.cells import Cells
from table_files.delimited import delimited_table
from table_files.open import Reader, delimited_cells
from table_files.open import reader_of as reader_of_file

# Files of a folder that were joined of others of it, known by what their cells say, not by their bytes.

NOTHING = frozenset({"", "na", "nan", "null", "none", "n/a"})
FEWEST_KINDS = 6
"""Rows of fewer kinds than this may be as many as those of others together by chance."""


class Joined(NamedTuple):
    """A file that has exactly the rows of two or more other files; `kinds` of them are distinct."""

    file: Path
    parts: tuple[Path, ...]
    kinds: int


def row_counts(rows: pd.DataFrame) -> Counter[int]:
    """How often each row is there; rows are alike whose numbers are (3 and 3.0), and blank ones are none."""
    alike = rows.apply(lambda column: column.map({text: _meaning(text) for text in column.unique()}))
    filled = alike[(alike != "").any(axis=1)]
    return Counter(pd.util.hash_pandas_object(filled, index=False).tolist())


def joined_of(counts: Mapping[Path, Counter[int]]) -> Joined | None:
    """The largest file whose rows are those of two others or more, copies of a file taken once.

    `counts` has of each file its rows in the columns that all files share, as of `row_counts`.
    """
    by_size = sorted(counts, key=lambda name: counts[name].total(), reverse=True)
    for position, name in enumerate(by_size):
        left, parts = Counter(counts[name]), []
        for other in by_size[position + 1 :]:
            # one of the same size is a copy, and makes no joined file of this one
            if 0 < counts[other].total() < counts[name].total() and counts[other] <= left:
                left -= counts[other]
                parts.append(other)
        if len(parts) > 1 and not left:
            return Joined(name, tuple(sorted(parts)), len(counts[name]))
    return None


def _meaning(text: str) -> str:
    """A cell as it is compared: 3.0 and 3,0 as 3, TRUE as true, NA as nothing."""
    text = text.strip().casefold()
    if text in NOTHING:
        return ""
    try:
        return f"{float(text.replace(',', '.')):.12g}"
    except ValueError:
        return text


DESCRIPTION = "dataset_description.json"
NAMED_FILES = 5
ORIGIN = "synthetic"
"""A column that is read though only some files have it: what was generated must not pass as given."""


@dataclass(frozen=True)
class DataFile:
    """A file with rows, the columns in it, and those that its name has in their place."""

    path: Path
    header: tuple[str, ...]
    beside: Mapping[str, str]

    @property
    def columns(self) -> tuple[str, ...]:
        """All of them, each once."""
        return tuple(dict.fromkeys([*self.header, *self.beside]))


@dataclass(frozen=True)
class Folder:
    """What is known of a folder before its columns are read: its files, and what is said of them."""

    files: tuple[DataFile, ...]
    said: tuple[str, ...]

    @property
    def header(self) -> list[str]:
        """Columns that every data file has, and that of the origin where one has it."""
        every = [set(file.columns) for file in self.files]
        shared = [name for name in self.files[0].columns if all(name in names for names in every)]
        origin = ORIGIN not in shared and any(ORIGIN in names for names in every)
        return [*shared, *[ORIGIN] * origin]


def reader_of(path: Path) -> Reader:
    """The reader of a file or a folder of files."""
    if path.is_dir():
        return Reader(lambda: header(path), lambda names: cells(path, names))
    return reader_of_file(path)


def header(folder: Path) -> list[str]:
    """Columns that every data file has, and those of the files' names."""
    return _known(folder).header


def cells(folder: Path, names: list[str]) -> Cells:
    """The columns `names` of all data files, one below the other."""
    known = _known(folder)
    parts = [_part(file, names) for file in known.files]
    return Cells(
        pd.concat([part.rows for part in parts], ignore_index=True),
        tuple(known.header),
        np.concatenate([part.lines for part in parts]),
        decisions=(*known.said, *_contradictions(known.files, parts, names)),
        files=np.repeat([file.path.name for file in known.files], [len(part.lines) for part in parts]),
    )


def names_of(folder: Path, path: Path) -> dict[str, str]:
    """Columns in a file's name: of `study-1_session-2_data.csv` in Psych-DS {study: 1, session: 2}."""
    if not _is_psych_ds(folder):
        return {"file": path.stem}
    parts = (part.partition("-") for part in path.stem.removesuffix("_data").split("_"))
    return {key: value for key, dash, value in parts if dash}


def _known(folder: Path) -> Folder:
    """The folder as it is now; gone through once for the header and for the cells."""
    paths = _data_paths(folder)
    # With times and sizes in the key: a file that has changed between two calls is read again.
    return _look_through(folder, tuple((p, p.stat().st_mtime_ns, p.stat().st_size) for p in paths))


@lru_cache(maxsize=2)
def _look_through(folder: Path, stamps: tuple[tuple[Path, int, int], ...]) -> Folder:
    paths = [path for path, *_ in stamps]
    tables = {path: _table(path) for path in paths}
    # any cell that holds something: of runs broken off programs write empty files
    filled = [path for path, rows in tables.items() if any(rows[name].str.strip().any() for name in rows)]
    if not filled:
        raise InputError(f"no data file of the folder {folder.resolve().name} has rows")
    files = tuple(DataFile(path, delimited_table(path).header, names_of(folder, path)) for path in filled)
    sort = "Psych-DS folder" if _is_psych_ds(folder) else "folder"
    said = [f"read {len(files)} data file{'s' * (len(files) > 1)} of the {sort} {folder.name}"]
    if without_rows := [path.name for path in paths if path not in filled]:
        said.append(f"files without rows ignored: {_listed(without_rows)}")
    if copies := _copies(filled):
        said.append(f"files that are identical to another file were also counted: {_listed(copies)}")
    return Folder(files, (*said, *_columns_of_some(files), *_joined(files, tables)))


def _data_paths(folder: Path) -> list[Path]:
    """The data files of the folder in the order of their names, but for hidden ones (macOS's `._p1.csv`)."""
    if _is_psych_ds(folder):
        candidates = (folder / "data").rglob("*_data.csv")
        expected = "data/..._data.csv in a Psych-DS folder"
    else:
        candidates = (path for path in folder.iterdir() if path.suffix.lower() == ".csv")
        expected = f".csv files, one per person, or a Psych-DS folder ({DESCRIPTION})"
    files = sorted(
        path
        for path in candidates
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts)
    )
    if not files:
        raise InputError(f"{folder.resolve().name} is a folder without data files; expected {expected}")
    return files


def _is_psych_ds(folder: Path) -> bool:
    return (folder / DESCRIPTION).is_file()


def _table(path: Path) -> pd.DataFrame:
    """All cells of a file, each column once; none of a file that holds nothing."""
    # Byte order marks, separators and blanks alone are nothing.
    if not path.read_bytes().strip(b"\xef\xbb\xbf\xff\xfe\0\r\n\t ,;"):
        return pd.DataFrame()
    return delimited_cells(path, list(dict.fromkeys(delimited_table(path).header))).rows


def _columns_of_some(files: Sequence[DataFile]) -> list[str]:
    """Name the columns that are left out because not every file has them."""
    times = Counter(name for file in files for name in file.columns if name)
    some = [name for name, count in times.items() if count < len(files)]
    lines = [f"only some files have a column '{ORIGIN}'; rows of the others are treated as given by people"]
    left = [name for name in some if name != ORIGIN]
    return [
        *lines * (ORIGIN in some),
        *[f"columns that only some files have were ignored: {_listed(left)}"] * bool(left),
    ]


def _joined(files: Sequence[DataFile], tables: Mapping[Path, pd.DataFrame]) -> list[str]:
    """Refuse a file into which others of the folder were joined: each of their rows would count twice.

    Where their rows are of few kinds, so that they may be alike by chance, it is said.
    """
    shared = [name for name in dict.fromkeys(files[0].header) if all(name in file.header for file in files)]
    # It takes three files: two parts, and the one that they were joined into.
    if not shared or len(files) <= 2:
        return []
    counts = {file.path: row_counts(tables[file.path][shared]) for file in files}
    joined = joined_of(counts)
    if joined is None:
        return []
    parts = [path.name for path in joined.parts]
    where = f"every row of {len(parts)} files ({_listed(parts)}) is also in {joined.file.name}"
    if joined.kinds < FEWEST_KINDS:
        return [f"{where}, by chance or because they were merged into it; all rows were counted"]
    raise InputError(f"{where} and would count twice; move that file, or the others, out of the folder")


def _copies(files: Sequence[Path]) -> list[str]:
    """Names of files whose bytes are those of a file before them."""
    seen: set[bytes] = set()
    copies = []
    for path in files:
        digest = sha256(path.read_bytes()).digest()
        if digest in seen:
            copies.append(path.name)
        seen.add(digest)
    return copies


def _contradictions(files: Sequence[DataFile], parts: Sequence[Cells], names: Sequence[str]) -> list[str]:
    """Report a column whose value differs from the one in the name of its file."""
    for file, part in zip(files, parts, strict=True):
        for name, value in file.beside.items():
            own = part.rows[name].iloc[0] if name in names else value
            if own != value:
                return [f"'{name}' is {own} in {file.path.name}; the column was used, not the file name"]
    return []


def _listed(names: Sequence[str]) -> str:
    rest = len(names) - NAMED_FILES
    return f"{', '.join(names[:NAMED_FILES])}{f' and {rest} more' if rest > 0 else ''}"


def _part(file: DataFile, names: list[str]) -> Cells:
    there = delimited_cells(file.path, [name for name in names if name in file.header])
    # the origin of rows is empty in a file that lacks it
    extra = {name: file.beside.get(name, "") for name in names if name not in file.header}
    return Cells(there.rows.assign(**extra)[names], there.header, there.lines)
