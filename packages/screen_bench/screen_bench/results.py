"""Results of the bench on disk, each as it ends, so that a run that was stopped goes on where it was.

A row is measured in pieces, each stored as it ends. The page docs/explanation/participant.md has their table.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from screen_bench.compare import Play, Record, Sight
from screen_bench.measure import Row

ROOT = Path(__file__).resolve().parents[3]
MEASURED = (
    "frontend/src/participant/playback",
    "server/participation/verdict.py",
    "experiments/rules/playback.py",
)
"""What draws clips and judges plays: with another one, earlier plays are of something else."""


@cache
def measured_sha256() -> str:
    """SHA-256 of all source files that draw and judge."""
    sources = [ROOT / source for source in MEASURED]
    files = sorted(
        file for source in sources for file in (source.rglob("*.ts") if source.is_dir() else [source])
    )
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()[:16]


@dataclass(frozen=True)
class Result:
    """One thing measured, once.

    Attributes
    ----------
    key : tuple of str
        What was measured.
    count : int
        Of how many plays.
    cells : tuple of str
        A line of the table, or one sentence.
    details : object
        All that was measured, as JSON has it.
    """

    key: tuple[str, ...]
    count: int
    cells: tuple[str, ...]
    at: str
    details: Any = None


class Results:
    """A file of results, one JSON object per line.

    Results of one key add up, and what has as many plays as asked for, or more, is not measured again. Those
    of other sources (`measured_sha256`) stay in the file and count for nothing; so do, with `again`,
    earlier ones.
    """

    def __init__(self, path: Path, again: bool = False) -> None:
        self.path = path
        self._known: dict[tuple[str, ...], list[Result]] = {}
        if path.is_file():
            for line in path.read_text(encoding="utf-8").splitlines():
                self._take(json.loads(line))
        self._anew = set(self._known) if again else set()

    def _take(self, stored: dict[str, Any]) -> None:
        key = tuple(stored["key"])
        if stored.get("measured") != measured_sha256():
            return
        if stored["anew"]:
            self._known.pop(key, None)
        result = Result(key, stored["count"], tuple(stored["cells"]), stored["at"], stored["details"])
        self._known.setdefault(key, []).append(result)

    def count(self, key: tuple[str, ...]) -> int:
        """How many plays there are of it."""
        return 0 if key in self._anew else sum(result.count for result in self._known.get(key, []))

    def has(self, key: tuple[str, ...], count: int) -> bool:
        """True where it was measured with as many plays already."""
        return self.count(key) >= count

    def add(self, key: tuple[str, ...], count: int, cells: Sequence[str], details: Any) -> None:
        """Write a result down at once."""
        stored = {
            "key": key,
            "count": count,
            "cells": list(cells),
            "at": datetime.now(UTC).isoformat(timespec="seconds"),
            "measured": measured_sha256(),
            "anew": key in self._anew,
            "details": details,
        }
        self._anew.discard(key)
        self._take(stored)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(stored) + "\n")

    def pieces(self, key: tuple[str, ...]) -> list[Result]:
        """All results of a key, the first one first."""
        return list(self._known.get(key, []))

    def keys(self, kind: str) -> list[tuple[str, ...]]:
        """All keys of a kind, which is their first word."""
        return [key for key in self._known if key[0] == kind]

    def of(self, kind: str) -> list[Result]:
        """The latest result of each key of a kind."""
        return [self._known[key][-1] for key in self.keys(kind)]


HEADER = (
    "browser", "fps", "condition", "plays", "not measured", "good", "good, yet off or a frame not shown",
    "right", "right, called otherwise", "worst off (ms)", "key to first pixel, median (95%) (ms)",
    "record's bias (ms)", "polls a second", "poller blind, longest (ms), share", "load",
)  # fmt: skip


def cells(row: Row) -> list[str]:
    """One line of the table. Plays that the poller could not follow count in their own column alone."""
    plays = [play for play in row.plays if play.is_measured]
    good = [play for play in plays if play.record.verdict == "good"]
    right = [play for play in plays if play.is_right]
    otherwise = [play for play in right if play.record.verdict != "good"]
    off = [play for play in good if play.is_off]
    return [
        row.browser,
        str(row.fps),
        row.condition,
        str(len(row.plays) + row.lost),
        str(len(row.plays) - len(plays) + row.lost),
        str(len(good)),
        _share(len(off), len(good)),
        str(len(right)),
        _share(len(otherwise), len(right)),
        f"{max((play.worst_off_ms for play in good), default=0):.0f}",
        _median_and_95([play.key_to_pixel_ms for play in plays]),
        _median_and_95([_bias(play) for play in plays if play.record.key_to_first_frame_ms is not None]),
        f"{row.polls_per_s:.0f}" + ("" if row.real_time else " (ordinary priority)"),
        f"{row.blind_ms:.0f}, {100 * row.blind_share:.1f}%",
        " to ".join(dict.fromkeys(f"{load:.1f}" for load in (min(row.loads), max(row.loads)))),
    ]


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f}%)" if whole else "0"


def _bias(play: Play) -> float:
    return play.key_to_pixel_ms - (play.record.key_to_first_frame_ms or 0.0)


def _median_and_95(values: Sequence[float]) -> str:
    if len(values) < 2:
        return "".join(f"{value:.0f}" for value in values)
    return f"{median(values):.0f} ({quantiles(values, n=20, method='inclusive')[-1]:.0f})"


def markdown(lines: Sequence[Sequence[str]]) -> str:
    """Lines of cells under the header."""
    table = [HEADER, tuple("---" for _ in HEADER), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in table)


PIECE_PLAYS = 40
"""Plays of one browser session: what a stopped bench loses at most."""
MAX_LOST_PIECES = 3
"""A browser that is starved or comes without its window in front costs its piece, and not the row."""


def measure_in_pieces(
    results: Results, key: tuple[str, ...], plays: int, measure_piece: Callable[[int], Row]
) -> None:
    """Add pieces to the results until there are `plays`; raises where three were lost."""
    lost = 0
    while (left := plays - results.count(key)) > 0:
        count = min(left, PIECE_PLAYS)
        try:
            row = measure_piece(count)
        except (RuntimeError, ValueError) as error:
            lost += 1
            if lost == MAX_LOST_PIECES:
                raise
            print(f"    a piece was not measured, and starts again: {error}", flush=True)
            continue
        results.add(key, count, cells(row), asdict(row))
        print(f"    {results.count(key)} of {plays} plays", flush=True)


def row_of(pieces: Sequence[dict[str, Any]]) -> Row:
    """One row of all its pieces, each as `asdict` made it and JSON kept it."""
    first = pieces[0]
    return Row(
        browser=first["browser"],
        version=", ".join(dict.fromkeys(piece["version"] for piece in pieces)),
        fps=first["fps"],
        condition=first["condition"],
        plays=tuple(_play(play) for piece in pieces for play in piece["plays"]),
        lost=sum(piece["lost"] for piece in pieces),
        polls_per_s=sum(piece["polls_per_s"] for piece in pieces) / len(pieces),
        real_time=all(piece["real_time"] for piece in pieces),
        loads=tuple(load for piece in pieces for load in piece["loads"]),
        blind_ms=max(piece["blind_ms"] for piece in pieces),
        blind_share=sum(piece["blind_share"] for piece in pieces) / len(pieces),
    )


def _play(stored: dict[str, Any]) -> Play:
    record = {**stored["record"], "drawn": _pairs(stored["record"]["drawn"])}
    sight = {**stored["sight"], "onsets": _pairs(stored["sight"]["onsets"])}
    return Play(**{**stored, "record": Record(**record), "sight": Sight(**sight)})


def _pairs(rows: Sequence[Sequence[float]]) -> tuple[tuple[int, float], ...]:
    return tuple((int(index), float(at_ms)) for index, at_ms in rows)
