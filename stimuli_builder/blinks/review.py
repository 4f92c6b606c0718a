"""A person's second look at the labels: blinks rejected or accepted again, kept with the reason."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Literal

import pandas as pd

from experiments.errors import InputError, did_you_mean
from stimuli_builder.blinks.measure import MeasuredBlink
from stimuli_builder.blinks.series import read_table, scaled_frames
from stimuli_builder.files import whole_file

Decision = Literal["accept", "reject"]
MATCH_FRAMES = 10
"""A decision belongs to the blink whose minimum is within so many frames (at 300 fps) of its own."""


@dataclass(frozen=True)
class Review:
    """One decision about one blink, found again by its column and minimum, not by its number."""

    column: str
    minimum_frame: int
    decision: Decision
    reason: str


def read_reviews(path: Path) -> list[Review]:
    """Read a review file; a file that is not there yet holds no decision."""
    if not path.exists():
        return []
    table = read_table(path)
    expected = [field.name for field in fields(Review)]
    if list(table.columns) != expected:
        raise InputError(f"{path.name} is no review file: expected the columns {', '.join(expected)}")
    return [_review(row, number, path) for number, row in enumerate(table.to_dict("records"), start=2)]


def _review(row: dict[object, object] | dict[str, object], number: int, path: Path) -> Review:
    values = {str(key): value for key, value in row.items()}
    word = str(values["decision"])
    decision: Decision = "accept" if word == "accept" else "reject"
    if word != decision:
        raise InputError(
            f"{path.name} row {number}: unknown decision '{word}'{did_you_mean(word, ['accept', 'reject'])}"
        )
    try:
        frame = int(str(values["minimum_frame"]))
    except ValueError as error:
        raise InputError(f"{path.name} row {number}: minimum_frame must be a whole number") from error
    reason = values["reason"]
    return Review(str(values["column"]), frame, decision, reason if isinstance(reason, str) else "")


def write_reviews(path: Path, reviews: Sequence[Review]) -> None:
    """Write all decisions, one row a blink."""
    with whole_file(path) as partial:
        columns = [field.name for field in fields(Review)]
        rows = [asdict(review) for review in reviews]
        pd.DataFrame(rows, columns=columns).to_csv(partial, index=False, lineterminator="\n")


def parse_choice(text: str, decision: Decision, blinks: Sequence[MeasuredBlink]) -> Review:
    """Turn `N=reason`, `N` or `COLUMN:N=reason` into a decision about one of `blinks`."""
    which, _, reason = text.partition("=")
    column, _, digits = which.rpartition(":")
    columns = list(dict.fromkeys(blink.column for blink in blinks))
    if not digits.strip().isdigit():
        raise InputError(f"--{decision} {text}: expected the number of a blink, as in --{decision} 3=reason")
    if decision == "reject" and not reason.strip():
        raise InputError(f"--reject {text}: say why, as in --reject {which}=talking")
    if not column and len(columns) > 1:
        raise InputError(f"--{decision} {text}: blink {digits} of which column? write {columns[0]}:{digits}")
    if column and column not in columns:
        raise InputError(f"--{decision} {text}: no column '{column}'{did_you_mean(column, columns)}")
    wanted = column or columns[0]
    for blink in blinks:
        if blink.column == wanted and blink.number == int(digits):
            return Review(wanted, blink.minimum_frame, decision, reason.strip())
    count = sum(blink.column == wanted for blink in blinks)
    raise InputError(f"--{decision} {text}: {wanted} has blinks 1 to {count}")


def merge(old: Sequence[Review], new: Sequence[Review], reach_frames: float) -> list[Review]:
    """Return the decisions with the new ones in place of old ones about the same blinks."""
    kept = [
        review
        for review in old
        if not any(
            later.column == review.column and abs(later.minimum_frame - review.minimum_frame) <= reach_frames
            for later in new
        )
    ]
    return kept + list(new)


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
