"""A person's second look at the labels: blinks rejected or accepted again, with the reason, or moved ends."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import pandas as pd

from experiments.errors import InputError, did_you_mean
from experiments.files import whole_file
from stimuli_builder.blinks.csv_table import read_table, write_table
from stimuli_builder.blinks.measure import MeasuredBlink
from stimuli_builder.blinks.series import scaled_frames

Decision = Literal["accept", "reject"]
MATCH_FRAMES = 10
"""A decision belongs to the blink whose minimum is within this many frames (at 300 fps) of the decision's."""


EDGE_COLUMNS = ("onset_frame", "end_frame")
"""Columns a review file may have besides: where a person moved a blink's start or end; empty where not."""


@dataclass(frozen=True)
class Review:
    """One decision about one blink, found again by its column and minimum, not by its number.

    `onset_frame` and `end_frame` take the place of the labeled ones; None leaves them.
    """

    column: str
    minimum_frame: int
    decision: Decision
    reason: str
    onset_frame: int | None = None
    end_frame: int | None = None

    @property
    def moves(self) -> bool:
        """Whether the blink's start or end was moved."""
        return self.onset_frame is not None or self.end_frame is not None


def read_reviews(path: Path) -> list[Review]:
    """Read a review file; a file that is not there yet holds no decision."""
    if not path.exists():
        return []
    table = read_table(path)
    expected = [field.name for field in fields(Review)]
    if list(table.columns) not in (expected[: -len(EDGE_COLUMNS)], expected):
        needed = ", ".join(expected[: -len(EDGE_COLUMNS)])
        raise InputError(
            f"{path.name} is not a review file: expected the columns {needed}, and optionally "
            f"{' and '.join(EDGE_COLUMNS)}"
        )
    return [_review(row, number, path) for number, row in enumerate(table.to_dict("records"), start=2)]


def _review(row: dict[object, object] | dict[str, object], number: int, path: Path) -> Review:
    values = {str(key): value for key, value in row.items()}
    word = str(values["decision"])
    decision: Decision = "accept" if word == "accept" else "reject"
    if word != decision:
        raise InputError(
            f"{path.name} line {number}: unknown decision '{word}'{did_you_mean(word, ['accept', 'reject'])}"
        )
    frame = _frame(values, "minimum_frame", number, path)
    if frame is None:
        raise InputError(f"{path.name} line {number}: minimum_frame must be a whole number")
    onset, end = (_frame(values, name, number, path) for name in EDGE_COLUMNS)
    if not (frame if onset is None else onset + 1) <= frame <= (frame if end is None else end - 1):
        raise InputError(
            f"{path.name} line {number}: expected onset_frame before and end_frame after "
            f"minimum_frame {frame}"
        )
    reason = values["reason"] if isinstance(values["reason"], str) else ""
    return Review(str(values["column"]), frame, decision, reason, onset, end)


def _frame(values: dict[str, object], name: str, number: int, path: Path) -> int | None:
    """Frame number in a column, None where the column is missing or empty."""
    value = values.get(name)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    try:
        # A column of whole numbers with empty cells is read as floats, one with a word as text.
        frame = float(str(value))
    except ValueError:
        frame = -1.0
    if not (frame >= 0 and frame.is_integer()):
        raise InputError(f"{path.name} line {number}: {name} must be a whole number, got {value!r}")
    return int(frame)


def write_reviews(path: Path, reviews: Sequence[Review]) -> None:
    """Write all decisions, one row per blink; the columns of moved ends only where an end was moved."""
    with whole_file(path) as partial:
        columns = [field.name for field in fields(Review)]
        table = pd.DataFrame([asdict(review) for review in reviews], columns=columns)
        table = table.astype(dict.fromkeys(EDGE_COLUMNS, "Int64"))
        if not any(review.moves for review in reviews):
            table = table.drop(columns=list(EDGE_COLUMNS))
        write_table(partial, table)


def parse_choice(text: str, decision: Decision, blinks: Sequence[MeasuredBlink]) -> Review:
    """Turn `N=reason`, `N` or `COLUMN:N=reason` into a decision about one of `blinks`."""
    if not blinks:
        raise InputError(f"--{decision} {text}: there is no blink to decide on")
    which, _, reason = text.partition("=")
    column, _, digits = which.rpartition(":")
    columns = list(dict.fromkeys(blink.column for blink in blinks))
    if not digits.strip().isdigit():
        raise InputError(
            f"--{decision} {text}: expected the number of a blink, such as --{decision} 3=reason"
        )
    if decision == "reject" and not reason.strip():
        raise InputError(f"--reject {text}: a reason is missing; use, for example, --reject {which}=talking")
    if not column and len(columns) > 1:
        raise InputError(
            f"--{decision} {text}: the column of blink {digits} is missing; use, for example, "
            f"{columns[0]}:{digits}"
        )
    if column and column not in columns:
        raise InputError(f"--{decision} {text}: no column '{column}'{did_you_mean(column, columns)}")
    chosen = column or columns[0]
    for blink in blinks:
        if blink.column == chosen and blink.number == int(digits):
            return Review(chosen, blink.minimum_frame, decision, reason.strip())
    count = sum(blink.column == chosen for blink in blinks)
    raise InputError(f"--{decision} {text}: {chosen} has blinks 1 to {count}")


def merge(old: Sequence[Review], new: Sequence[Review], reach_frames: float) -> list[Review]:
    """Return the decisions with the new ones in place of old ones about the same blinks; moved ends stay."""
    kept = []
    merged = list(new)
    for review in old:
        same = [
            index
            for index, later in enumerate(merged)
            if later.column == review.column
            and abs(later.minimum_frame - review.minimum_frame) <= reach_frames
        ]
        if not same:
            kept.append(review)
        for index in same:
            if not merged[index].moves:
                merged[index] = replace(
                    merged[index], onset_frame=review.onset_frame, end_frame=review.end_frame
                )
    return kept + merged


def moved_edges(
    blinks: Sequence[MeasuredBlink], decided: Mapping[tuple[str, int], Review], column: str
) -> dict[int, tuple[int, int]]:
    """Return minimum -> (onset, end) of a column's blinks whose start or end a person moved.

    Raises
    ------
    InputError
        A moved blink would reach into its neighbor.
    """
    own = [blink for blink in blinks if blink.column == column]
    edges: list[tuple[int, int, int]] = []
    moved = {}
    for blink in own:
        review = decided.get((column, blink.number))
        onset, end = blink.onset_frame, blink.end_frame
        if review is not None and review.moves:
            onset = onset if review.onset_frame is None else review.onset_frame
            end = end if review.end_frame is None else review.end_frame
            moved[blink.minimum_frame] = (onset, end)
        edges.append((blink.number, onset, end))
    for (number, onset, end), (later, start, stop) in pairwise(edges):
        overlaps = start < end
        changed = own[number - 1].minimum_frame in moved or own[later - 1].minimum_frame in moved
        if overlaps and changed:
            raise InputError(
                f"the review moves blink {number} ({onset} to {end}) and blink {later} ({start} to {stop}) "
                f"of {column} so that they overlap; separate the start and end"
            )
    return moved


def match_frames(fps: float) -> float:
    """Greatest distance in frames between a decision's minimum and its blink's."""
    return max(1.0, scaled_frames(MATCH_FRAMES, fps))


def decide(
    blinks: Sequence[MeasuredBlink], reviews: Sequence[Review], reach_frames: float
) -> tuple[dict[tuple[str, int], Review], list[Review]]:
    """Return the decision on each blink, by column and number, and the decisions that match no blink."""
    decided: dict[tuple[str, int], Review] = {}
    lost = []
    for review in reviews:
        near = [
            blink
            for blink in blinks
            if blink.column == review.column
            and abs(blink.minimum_frame - review.minimum_frame) <= reach_frames
        ]
        if near:
            best = min(near, key=lambda blink: abs(blink.minimum_frame - review.minimum_frame))
            decided[best.column, best.number] = review
        else:
            lost.append(review)
    return decided, lost
