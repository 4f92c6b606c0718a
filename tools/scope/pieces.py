"""A row measured in pieces, each stored as it ends: back from the file, and put together."""

from collections.abc import Sequence
from typing import Any

from tools.scope.compare import Play, Record, Sight
from tools.scope.measure import Row

PIECE_PLAYS = 40
"""Plays of one browser session: what a stopped bench loses at most."""


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
