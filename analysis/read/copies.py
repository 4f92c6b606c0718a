"""Blocks of rows that are in a table twice, as where a file was pasted twice."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Codes = NDArray[np.int64]

FEWEST = 6
"""Rows from which a block that is there twice is a copy and no coincidence, if hardly a row comes again."""

MANY = 40
"""Rows from which it is one although rows come again within it."""

UNLIKELY = 16.0
"""Logarithm of how many times less likely than chance a copy is, over all pairs of places in the table."""

OFFSETS = 8
"""Distances between a row and its copy that are tried, the most frequent first."""


def row_codes(rows: pd.DataFrame) -> Codes:
    """Codes (n,) of the rows: equal where every column is equal."""
    codes = np.zeros(len(rows), np.int64)
    for name in range(rows.shape[1]):
        column, names = pd.factorize(rows.iloc[:, name])
        codes = np.asarray(pd.factorize(codes * (len(names) + 1) + column)[0], np.int64)
    return codes


def copied_block(codes: Codes) -> tuple[int, int, int] | None:
    """The longest block that repeats earlier rows in their order: its first row, the original's, its length.

    Rows that come again by chance (a rating of the same condition) make short blocks, or ones of a few
    different rows; neither counts.
    """
    n = len(codes)
    counts = np.bincount(codes)
    if n < 2 * FEWEST or counts.max() < 2:
        return None
    surprise = np.log(n / counts)[codes]
    best: tuple[int, int, int] | None = None
    for distance in _distances(codes):
        equal = codes[distance:] == codes[:-distance]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
        starts, lengths = edges[::2], np.minimum(edges[1::2] - edges[::2], distance)
        if not lengths.size:
            continue
        at = int(np.argmax(lengths))
        start, length = int(starts[at]), int(lengths[at])
        if best is not None and length <= best[2]:
            continue
        block = codes[start : start + length]
        distinct = len(np.unique(block))
        varied = distinct >= 0.7 * length if length < MANY else distinct >= FEWEST // 2
        unlikely = surprise[start : start + length].sum() > UNLIKELY + 2 * np.log(n)
        if length >= FEWEST and varied and unlikely and _beyond_chance(lengths, length, len(equal)):
            best = start + distance, start, length
    return best


def _beyond_chance(lengths: Codes, longest: int, places: int) -> bool:
    """Whether a run of equal rows is longer than those at this distance lead to expect.

    Ratings of one person in the same conditions agree often at a distance of one round of conditions. How
    often is what the short runs show; a copy is a long run among few of them.
    """
    long = 2 * lengths >= longest
    left = places - int(lengths[long].sum())
    rate = (int(lengths[~long].sum()) + 1) / (max(left, 0) + 2)
    return bool(longest * -np.log(rate) > UNLIKELY + np.log(places))


def _distances(codes: Codes) -> list[int]:
    """Distances of rows from the one before that is equal, and from the first; the most frequent first."""
    n = len(codes)
    first = np.full(int(codes.max()) + 1, n)
    np.minimum.at(first, codes, np.arange(n))
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


def said_of_copies(codes: Codes, lines: Sequence[str]) -> str:
    """What is said of a block of exact copies, or of rows that all occur twice; empty without."""
    block = copied_block(codes)
    if block is not None:
        copy, original, length = block
        return (
            f"lines {lines[copy]} to {lines[copy + length - 1]} are exact copies of lines {lines[original]} "
            f"to {lines[original + length - 1]} ({length} rows): was something pasted twice? All rows count; "
            "if they are copies, delete them and run this again"
        )
    times = all_rows_twice(codes)
    if times > 1:
        often = "twice" if times == 2 else f"{times} times"
        return (
            f"every row is in the table {often}: was something pasted twice? All rows count; if they are "
            "copies, delete them and run this again"
        )
    return ""
