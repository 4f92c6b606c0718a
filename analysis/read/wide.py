"""Wide tables, one row a person and one column a cell of the design, made long."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from math import prod
from pathlib import Path

import pandas as pd

from analysis.read.copies import row_codes, said_of_copies
from analysis.read.files.cells import Cells
from analysis.read.files.open import reader_of
from experiments.errors import InputError

_PLACEHOLDER = re.compile(r"\{([^{}]+)\}")
FEWEST_COLUMNS = 3
"""So many columns alike look like the cells of a wide table."""


@dataclass(frozen=True)
class LongTable:
    """Rows, one a person and cell; factors in the columns' names; what stayed beside; what was understood."""

    rows: pd.DataFrame
    factors: tuple[str, ...]
    n_columns: int
    beside: tuple[str, ...]
    decisions: tuple[str, ...]


def wide_hint(header: Sequence[str]) -> str:
    """What to do about a header that looks like that of a wide table; nothing where it does not."""
    for separator in ("_", ".", "-"):
        parts = [name.split(separator) for name in header]
        for size in sorted({len(part) for part in parts} - {1}):
            group = [part for part in parts if len(part) == size]
            levels = [sorted({part[i] for part in group}) for i in range(size)]
            if len(group) >= FEWEST_COLUMNS and prod(map(len, levels)) == len(group):
                return _hint(separator.join(group[0]), _named(levels, separator))
    numbered = [match for name in header if (match := re.fullmatch(r"(\D+?)\d+", name))]
    for stem in dict.fromkeys(match[1] for match in numbered):
        group_of_stem = [match[0] for match in numbered if match[1] == stem]
        if len(group_of_stem) >= FEWEST_COLUMNS:
            return _hint(group_of_stem[0], f"{stem}{{factor1}}")
    return ""


def _named(levels: Sequence[Sequence[str]], separator: str) -> str:
    """The pattern of names: what varies is a factor."""
    numbers = count(1)
    parts = (names[0] if len(names) == 1 else f"{{factor{next(numbers)}}}" for names in levels)
    return separator.join(parts)


def _hint(first: str, pattern: str) -> str:
    return (
        f"; the table looks wide (a column like '{first}' a cell): make it long with "
        f"analysis reshape FILE --columns '{pattern}' --out long.csv"
    )


def lengthen(path: Path, pattern: str, rating: str) -> LongTable:
    """Make a wide table long.

    Parameters
    ----------
    path : Path
        Any file that the analysis reads.
    pattern : str
        Names of the columns of cells, each factor in braces: `{face}_{blur}`, `t{time}`.
    rating : str
        Name of the new column of numbers.

    Raises
    ------
    InputError
        A pattern without a factor, that no column fits, or that fits one in two ways; a name taken.
    """
    reader = reader_of(path)
    header = [name for name in reader.header() if name]
    factors = tuple(_PLACEHOLDER.findall(pattern))
    _refuse_pattern(pattern, factors)
    levels = {
        name: levels_of_column for name in header if (levels_of_column := _levels(pattern, name)) is not None
    }
    if not levels:
        raise InputError(f"no column of {path.name} fits '{pattern}'; its columns: {', '.join(header)}")
    beside = tuple(name for name in header if name not in levels)
    for name in (*factors, rating):
        if name in beside:
            raise InputError(
                f"{path.name} has a column '{name}' already; choose another name for the new one"
            )
    read = reader.cells(header)
    cells = _with_words(read, beside)
    parts = [
        cells[list(beside)].assign(
            **dict(zip(factors, levels_of_column, strict=True)), **{rating: cells[name]}
        )
        for name, levels_of_column in levels.items()
    ]
    rows = pd.concat(parts).sort_index(kind="stable").reset_index(drop=True)
    copies = said_of_copies(row_codes(read.rows), [str(line) for line in read.lines])
    decisions = (*read.decisions, *([copies] if copies else []))
    return LongTable(rows, factors, len(levels), beside, decisions)


def _with_words(read: Cells, beside: Sequence[str]) -> pd.DataFrame:
    """Words in the place of the codes of what stays beside, where each code has a word of its own."""
    words = {name: read.labels[name] for name in beside if name in read.labels}
    distinct = {name: dict(of) for name, of in words.items() if len(set(of.values())) == len(of)}
    return read.rows.assign(**{name: read.rows[name].replace(of) for name, of in distinct.items()})


def _refuse_pattern(pattern: str, factors: tuple[str, ...]) -> None:
    if not factors:
        raise InputError(f"'{pattern}' names no factor; expected e.g. '{{face}}_{{blur}}'")
    if len(set(factors)) < len(factors):
        raise InputError(f"'{pattern}' names a factor twice")
    if re.search(r"\}\{", pattern):
        raise InputError(
            f"'{pattern}': two factors must have something between them, e.g. '{{face}}_{{blur}}'"
        )


def _levels(pattern: str, name: str) -> tuple[str, ...] | None:
    """The levels that a column's name holds; None where it does not fit."""
    literal = _PLACEHOLDER.split(pattern)[::2]
    short, long = (
        re.fullmatch(pattern_of_level.join(re.escape(part) for part in literal), name)
        for pattern_of_level in ("(.+?)", "(.+)")
    )
    if short is None or long is None:
        return None
    if short.groups() != long.groups():
        raise InputError(
            f"column '{name}' fits '{pattern}' in two ways ({' | '.join(short.groups())} or "
            f"{' | '.join(long.groups())}); rename the column"
        )
    return short.groups()
