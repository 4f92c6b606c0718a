"""What `stimuli scope` prints, and the CSV of onsets."""

import csv
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from experiments.files import whole_text
from stimuli_builder.sync_patch.onsets import PlayOnScreen
from stimuli_builder.sync_patch.photodiode import Changes

COLUMNS = ("play", "frame", "onset_ms", "within_ms", "interval_ms", "late_ms")
LONG_SHARE = 1.5
"""An interval of more than this many frames' time is named as long."""
NAMED_MAX = 12


def of_film(plays: Sequence[PlayOnScreen], pictures_per_s: float) -> list[str]:
    """A line a play, and one over all."""
    lines = [
        f"{len(plays)} play(s) of {plays[0].frames} frames at {plays[0].fps:g} fps; "
        f"onsets to within {500 / pictures_per_s:.1f} ms ({pictures_per_s:.0f} pictures a second)"
    ]
    lines += [f"play {number}: {_play(play)}" for number, play in enumerate(plays, start=1)]
    complete = sum(not play.missing for play in plays)
    worst = max(max(abs(late) for late in play.late_ms) for play in plays)
    return [*lines, f"{complete} of {len(plays)} play(s) without a missing frame; worst {worst:.1f} ms off"]


def _play(play: PlayOnScreen) -> str:
    missing = play.missing
    named = ", ".join(str(frame) for frame in missing[:NAMED_MAX])
    more = "" if len(missing) <= NAMED_MAX else f" and {len(missing) - NAMED_MAX} more"
    gone = f"{len(missing)} missing ({named}{more})" if missing else "none missing"
    intervals, late = play.intervals_ms, play.late_ms
    return (
        f"{gone}; intervals {min(intervals):.1f} to {max(intervals):.1f} ms; "
        f"{min(late):+.1f} to {max(late):+.1f} ms off the clip's times"
    )


def of_trace(changes: Changes) -> list[str]:
    """A line a play: a photodiode sees changes and no numbers."""
    lines = []
    for number, steps in enumerate(changes.intervals_ms(), start=1):
        long = [step for step in steps if step > LONG_SHARE * changes.period_ms]
        ends = f"intervals {min(steps):.1f} to {max(steps):.1f} ms" if steps else "no interval"
        lines.append(
            f"play {number}: {len(steps) + 1} changes; {ends}; {len(long)} longer than a frame and a half"
        )
    return [*lines, "A photodiode cannot tell a missing frame from a late one; a film of the patch can."]


def rows_of_film(plays: Sequence[PlayOnScreen]) -> list[tuple[object, ...]]:
    """One row a frame, as in COLUMNS."""
    return [
        (number, onset.frame, *(round(value, 3) for value in (onset.at_ms, onset.within_ms, interval, late)))
        for number, play in enumerate(plays, start=1)
        for onset, interval, late in zip(play.onsets, play.intervals_ms, play.late_ms, strict=True)
    ]


def rows_of_trace(changes: Changes) -> list[tuple[object, ...]]:
    """One row a change; which frame it was is not known."""
    return [
        (number, "", round(at_ms, 3), "", round(step, 3) if step is not None else "", "")
        for number, times in enumerate(changes.plays, start=1)
        for at_ms, step in zip(times, [*(b - a for a, b in pairwise(times)), None], strict=True)
    ]


def write_csv(path: Path, rows: Sequence[tuple[object, ...]]) -> None:
    """Write the table whole or not at all."""
    with whole_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)
