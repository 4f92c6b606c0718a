"""Wide tables, one row per person and one column per cell of the design, made long."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from math import ceil, log10, prod
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.folder import reader_of
from experiments.errors import InputError, did_you_mean
from table_files.cells import Cells

# Blocks of rows that are in a table twice, as where a file was pasted twice.

Codes = NDArray[np.int64]

FEWEST = 6
"""Rows from which a block that is there twice is a copy and no coincidence, if hardly a row comes again."""

MANY = 40
"""Rows from which it is one although rows come again within it."""

CHANCE_MAX = 1e-6
"""A block is named as a copy where chance makes one anywhere in the table with a smaller probability."""

OFFSETS = 8
"""Distances between a row and its copy that are tried, the most frequent first."""


def row_codes(rows: pd.DataFrame) -> Codes:
    """Codes (n,) of the rows: equal where every column is equal."""
    codes = np.zeros(len(rows), np.int64)
    for name in range(rows.shape[1]):
        column, names = pd.factorize(rows.iloc[:, name])
        codes = np.asarray(pd.factorize(codes * (len(names) + 1) + column)[0], np.int64)
    return codes


@dataclass(frozen=True)
class CopiedBlock:
    """Rows that repeat earlier ones in their order.

    Attributes
    ----------
    first, original, length : int
        The first of them, the first of those that they repeat, and how many they are.
    chance : float
        Bound on the probability that chance alone makes such a block anywhere in the table.
    """

    first: int
    original: int
    length: int
    chance: float


def copied_block(rows: pd.DataFrame) -> CopiedBlock | None:
    """The longest block of copies for which chance has a probability below `CHANCE_MAX`; None without.

    Rows that come again by chance (a rating of the same condition) make short blocks, or ones of a few
    different rows; neither counts.
    """
    codes = row_codes(rows)
    n = len(codes)
    counts = np.bincount(codes)
    if n < 2 * FEWEST or counts.max() < 2:
        return None
    surprise = np.log(n / counts)[codes]
    best: CopiedBlock | None = None
    distances = _distances(codes)
    for distance in distances:
        equal = codes[distance:] == codes[:-distance]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
        # Longer than its distance, a block would overlap with its copy.
        starts, lengths = edges[::2], np.minimum(edges[1::2] - edges[::2], distance)
        if not lengths.size:
            continue
        at = int(np.argmax(lengths))
        start, length = int(starts[at]), int(lengths[at])
        if best is not None and length <= best.length:
            continue
        block = codes[start : start + length]
        distinct = len(np.unique(block))
        varied = distinct >= 0.7 * length if length < MANY else distinct >= FEWEST // 2
        if length < FEWEST or not varied:
            continue
        # By the frequencies of rows, over all pairs of places; and by how often rows agree in this table.
        of_rows = 2 * np.log(n) - surprise[start : start + length].sum()
        rate = max(
            _usual_rate(lengths, length, len(equal)), _other_rate(codes, distances, distance, start, length)
        )
        of_design = np.log(len(distances) * len(equal)) + length * np.log(rate)
        chance = float(np.exp(min(0.0, max(of_rows, of_design))))
        if chance < CHANCE_MAX:
            best = CopiedBlock(start + distance, start, length, chance)
    return best


def _usual_rate(lengths: Codes, longest: int, places: int) -> float:
    """How often rows agree at this distance, by the runs that are clearly shorter than the longest."""
    long = 10 * lengths >= 9 * longest
    left = places - int(lengths[long].sum())
    # Laplace's rule of succession, which gives neither 0 nor 1.
    return (int(lengths[~long].sum()) + 1) / (max(left, 0) + 2)


def _other_rate(codes: Codes, distances: Sequence[int], distance: int, start: int, length: int) -> float:
    """How often the block's rows agree with rows at other distances, the one at which they do most often.

    Ratings of one person in the same conditions agree often a round later, and a round after that: nothing
    was copied there. Multiples of the distance do not count, where further copies would be.
    """
    rates, n = [0.0], len(codes)
    for far in distances:
        if far % distance == 0:
            continue
        for shift in (-far, far):
            for of in (start, start + distance):
                low, high = max(of, -shift, 0), min(of + length, n - shift, n)
                if 2 * (high - low) >= length:
                    same = codes[low:high] == codes[low + shift : high + shift]
                    rates.append((int(same.sum()) + 1) / (high - low + 2))
    return max(rates)


def _distances(codes: Codes) -> list[int]:
    """Distances of rows from the one before that is equal, and from the first; the most frequent first."""
    n = len(codes)
    first = np.full(int(codes.max()) + 1, n)
    np.minimum.at(first, codes, np.arange(n))
    # A stable sort keeps equal rows in their order: the one before each is the latest that is equal.
    order = np.argsort(codes, kind="stable")
    before = np.full(n, -1)
    same = codes[order][1:] == codes[order][:-1]
    before[order[1:][same]] = order[:-1][same]
    again = before >= 0
    rows = np.flatnonzero(again)
    distances: list[int] = []
    for far in (rows - before[again], rows - first[codes[again]]):
        values, counts = np.unique(far, return_counts=True)
        distances += [int(value) for value in values[np.argsort(-counts)[:OFFSETS]]]
    return list(dict.fromkeys(distances))


def all_rows_twice(codes: Codes) -> int:
    """How often each row of a table occurs, where all do as often and twice or more; else 1."""
    counts = np.bincount(codes)
    least = int(np.gcd.reduce(counts))
    return least if least > 1 and len(counts) >= 2 * FEWEST and len(counts) * least > len(codes) / 2 else 1


def said_of_copies(rows: pd.DataFrame, lines: Sequence[str]) -> str:
    """What is said of a block of exact copies, or of rows that all occur twice; empty without."""
    block = copied_block(rows)
    if block is not None:
        copy, original, length = block.first, block.original, block.length
        return (
            f"lines {lines[copy]} to {lines[copy + length - 1]} are exact copies of lines {lines[original]} "
            f"to {lines[original + length - 1]} ({length} rows), which happens by chance with a probability "
            f"below {_power_of_ten(block.chance)}. Was something pasted twice? All rows were counted; if "
            "they are copies, delete them and run this again"
        )
    times = all_rows_twice(row_codes(rows))
    if times > 1:
        often = "twice" if times == 2 else f"{times} times"
        return (
            f"every row is in the table {often}. Was something pasted twice? All rows were counted; if they "
            "are copies, delete them and run this again"
        )
    return ""


def _power_of_ten(chance: float) -> str:
    return f"1e{min(-6, ceil(log10(max(chance, 1e-99))))}"


_PLACEHOLDER = re.compile(r"\{([^{}]+)\}")
FEWEST_COLUMNS = 3
"""So many columns alike look like the cells of a wide table."""


@dataclass(frozen=True)
class LongTable:
    """Rows, one per person and cell; factors from the column names; unchanged columns; decisions."""

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
        f"; the table looks wide (one column per cell, such as '{first}'); make it long with analysis "
        f"reshape FILE --columns '{pattern}' --out long.csv"
    )


def lengthen(path: Path, pattern: str, rating: str, kept: Sequence[str] = ()) -> LongTable:
    """Make a wide table long.

    Parameters
    ----------
    path : Path
        Any file that the analysis reads.
    pattern : str
        Names of the columns of cells, each factor in braces: `{face}_{blur}`, `t{time}`.
    rating : str
        Name of the new column of numbers.
    kept : sequence of str
        Columns that are not cells, even if the pattern fits them.

    Raises
    ------
    InputError
        A pattern without a factor, that no or every column fits, or that fits one in two ways; a name that is
        taken or missing.
    """
    reader = reader_of(path)
    header = [name for name in reader.header() if name]
    refuse_names_twice(header, path.name)
    factors = tuple(_PLACEHOLDER.findall(pattern))
    _refuse_pattern(pattern, factors)
    for name in kept:
        if name not in header:
            raise InputError(f"{path.name} has no column '{name}'{did_you_mean(name, header)}")
    levels = {
        name: levels_of_column
        for name in header
        if name not in kept and (levels_of_column := _levels(pattern, name)) is not None
    }
    if len(levels) == len(header):
        raise InputError(
            f"'{pattern}' fits every column of {path.name}, so none says who rated; if one of them does, "
            "keep it, as in --keep id"
        )
    if not levels:
        raise InputError(f"no column of {path.name} fits '{pattern}'; its columns: {', '.join(header)}")
    beside = tuple(name for name in header if name not in levels)
    for name in (*factors, rating):
        if name in beside:
            raise InputError(
                f"{path.name} already has a column '{name}'; choose another name for the new column"
            )
    read = reader.cells(header)
    cells = _with_words(read, beside)
    parts = [
        cells[list(beside)].assign(
            **dict(zip(factors, levels_of_column, strict=True)), **{rating: cells[name]}
        )
        for name, levels_of_column in levels.items()
    ]
    # The cells of each person together, in the order of the columns.
    rows = pd.concat(parts).sort_index(kind="stable").reset_index(drop=True)
    copies = said_of_copies(read.rows, [str(line) for line in read.lines])
    decisions = (*read.decisions, *([copies] if copies else []))
    return LongTable(rows, factors, len(levels), beside, decisions)


def refuse_names_twice(header: Sequence[str], source: str) -> None:
    """Refuse names that two columns have; unnamed columns are not read."""
    # counted once for all: a header may have 100,000 names
    for name, times in Counter(header).items():
        if name and times > 1:
            raise InputError(f"{source} has two columns called '{name}'; rename one")


def _with_words(read: Cells, beside: Sequence[str]) -> pd.DataFrame:
    """Labels instead of codes in unchanged columns, where each code has a different label."""
    words = {name: read.labels[name] for name in beside if name in read.labels}
    distinct = {name: dict(of) for name, of in words.items() if len(set(of.values())) == len(of)}
    return read.rows.assign(**{name: read.rows[name].replace(of) for name, of in distinct.items()})


def _refuse_pattern(pattern: str, factors: tuple[str, ...]) -> None:
    if not factors:
        raise InputError(f"'{pattern}' names no factor; expected, for example, '{{face}}_{{blur}}'")
    if len(set(factors)) < len(factors):
        raise InputError(f"'{pattern}' names a factor twice")
    if re.search(r"\}\{", pattern):
        raise InputError(
            f"'{pattern}': two factors must have something between them, e.g. '{{face}}_{{blur}}'"
        )


def _levels(pattern: str, name: str) -> tuple[str, ...] | None:
    """The levels that a column's name holds; None where it does not fit."""
    literal = _PLACEHOLDER.split(pattern)[::2]
    # By the shortest and by the longest levels: where both agree, the name fits in one way.
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
