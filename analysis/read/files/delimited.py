"""CSV and its kin: comma, semicolon or tab, taken from the header line."""

import csv
import warnings
from io import TextIOWrapper
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.read.files.cells import Cells
from analysis.read.files.raggedness import lines_of_rows
from experiments.errors import InputError
from experiments.spreadsheet import unguarded_cell
from experiments.text_tables import separator_of, utf8_stream


def delimited_header(path: Path) -> tuple[list[str], str]:
    """Names of the columns, and the separator."""
    try:
        with TextIOWrapper(utf8_stream(path), encoding="utf-8-sig", newline="") as lines:
            first = lines.readline()
            separator = separator_of(first)
            lines.seek(0)
            rows = csv.reader(lines, delimiter=separator)
            header = next(rows, [])
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    except csv.Error as error:
        raise InputError(f"{path.name} is not a CSV file: {error}") from error
    if not any(name.strip() for name in header):
        raise InputError(f"{path.name} is empty; expected a header line and one row a trial")
    return [unguarded_cell(name.strip()) for name in header], separator


def delimited_cells(path: Path, names: list[str]) -> Cells:
    """The columns `names` of a CSV file; rows of unequal length are refused."""
    header, separator = delimited_header(path)
    with utf8_stream(path) as file:
        lines = lines_of_rows(file, separator, len(header), path.name)[1:]
    frame = _parse(path, separator, [header.index(name) for name in names], len(header))
    frame.columns = pd.Index(names)
    if len(lines) != len(frame):  # a header of several lines, or cells of blanks in a table of one column
        lines = np.arange(len(frame), dtype=np.int64) + 2
    return Cells(frame, tuple(header), lines)


def _parse(path: Path, separator: str, positions: list[int], width: int) -> pd.DataFrame:
    try:
        with warnings.catch_warnings(), utf8_stream(path) as file:
            warnings.simplefilter("error")
            frame = pd.read_csv(
                file,
                sep=separator,
                header=None,
                skiprows=1,
                names=range(width),
                usecols=sorted(positions),
                dtype=str,
                keep_default_na=False,
                encoding="utf-8-sig",
                index_col=False,
                skip_blank_lines=True,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame(columns=positions)
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        text = " ".join(str(error).split())
        raise InputError(f"{path.name}: not a CSV file ({text})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    chosen = frame[positions].copy()
    for column in chosen:
        # An export writes an apostrophe before texts that would run as formulas.
        if chosen[column].str.contains("'", regex=False).any():
            chosen[column] = chosen[column].map(unguarded_cell)
    return chosen
