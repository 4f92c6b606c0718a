"""A CSV with a header line as a table, however a spreadsheet wrote it: commas, semicolons or tabs."""

import re
from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import pandas as pd

from experiments.errors import InputError

NOTE = "note"
"""Key of `DataFrame.attrs` under which a table says how it was read; absent where that is plain."""
MAX_NAMED = 6
_SEPARATORS = {";": "semicolons", "\t": "tabs"}
_COMMA_OR_WHOLE = re.compile(r"[+-]?[0-9]+(,[0-9]+)?")


def read_table(path: Path) -> pd.DataFrame:
    """Read a series, track, review or table of profiles, column names stripped of blanks.

    The separator is taken from the header line. Decimal commas are read as points; `attrs[NOTE]` then
    says so, for the person to see.

    Parameters
    ----------
    path : Path

    Returns
    -------
    DataFrame

    Raises
    ------
    InputError
        A folder, no UTF-8 text, or no table with rows.
    """
    text = _text(path)
    header = text.splitlines()[0]
    separator = max(",;\t", key=header.count)
    try:
        table = pd.read_csv(StringIO(text), sep=separator, skipinitialspace=True)
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise InputError(f"{path}: expected a CSV table with a header line ({str(error).strip()})") from error
    table.columns = table.columns.astype(str).str.strip()
    if table.empty:
        raise InputError(f"{path}: the table has a header but no rows")
    said = [f"columns parted by {_SEPARATORS[separator]}"] if separator in _SEPARATORS else []
    if example := _read_decimal_commas(table):
        said.append(f"decimal commas (e.g. '{example}') read as decimal points")
    if said:
        table.attrs[NOTE] = f"{path.name}: {', '.join(said)}"
    return table


def few(names: Sequence[str]) -> str:
    """The first names of columns; a table of face tracking has sixty, too many for a line."""
    rest = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {rest} more" if rest > 0 else "")


def _text(path: Path) -> str:
    if path.is_dir():
        raise InputError(f"{path}: expected a CSV file, this is a folder; name a file in it")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    if "\0" in text:
        raise InputError(f"{path} is not UTF-8 text (it holds null bytes); save it as CSV UTF-8")
    if not text.strip():
        raise InputError(f"{path} is empty; expected a CSV table with a header line")
    return text.lstrip("\r\n")


def _read_decimal_commas(table: pd.DataFrame) -> str:
    """Make numbers of the columns written with decimal commas; return one of their cells, or nothing."""
    example = ""
    for name in table.columns[[kind.kind not in "fiub" for kind in table.dtypes]]:
        words = [str(word).strip() for word in table[name].dropna()]
        commas = [word for word in words if "," in word]
        if commas and all(map(_COMMA_OR_WHOLE.fullmatch, words)):
            example = example or commas[0]
            table[name] = pd.to_numeric(table[name].astype(str).str.replace(",", "."), errors="coerce")
    return example
