"""A row measured in pieces, each stored as it ends: back from the file, and put together."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from tools.scope.compare import Play, Record, Sight
from tools.scope.measure import Row
from tools.scope.results import Results
from tools.scope.table import cells

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
            print(f"    a piece was not measured, and is begun anew: {error}", flush=True)
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
