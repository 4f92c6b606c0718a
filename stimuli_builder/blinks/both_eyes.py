"""Both eyes of a recording: blinks of the same moment, their profiles, and an eye that moves less."""

from collections.abc import Collection, Sequence

import numpy as np

from experiments.errors import counted
from stimuli_builder.blinks.columns import eye_of, eye_pair, left_and_right
from stimuli_builder.blinks.csv_table import few
from stimuli_builder.blinks.extract import EyeBlinks, eye_profiles
from stimuli_builder.blinks.measure import MeasuredBlink, closure_at_300
from stimuli_builder.blinks.profile import BlinkProfile, Eye


def asymmetry_lines(
    eyes: Sequence[EyeBlinks], rejected: Collection[tuple[str, int]] = frozenset()
) -> list[str]:
    """Lines about winks, and an eye that moves much less than the other; none where both move alike.

    `rejected` are the blinks, by column and number, that a review takes for none.
    """
    columns = [eye.series.column for eye in eyes]
    pair = eye_pair(columns)
    fellow = "the other column" if pair is None else "the other eye"
    lines = []
    if len(eyes) > 2 and pair is None and eyes[0].recognised is not None:
        lines.append(
            f"no two of the {len(eyes)} columns ({few(columns)}) are named as left and right eye: each is "
            "judged separately, and an eye that moves less is not reported"
        )
    for eye in eyes:
        winks_s = _winks_s(eye, rejected)
        if winks_s:
            alone = f"{counted(len(winks_s), 'blink')} of this eye only, {fellow} open"
            lines.append(f"{_label(eye)}: {alone}, first at {winks_s[0]:.1f} s")
        side = None if eye.recognised is None else eye.recognised.asymmetry
        # An eye that blinks more often than the other is not the one that does not move.
        if side is None or not side.is_weak or len(eye.blinks) > side.blinks:
            continue
        others = f"{fellow}'s {counted(side.blinks, 'blink')}"
        if side.moves:
            how = f"moves by {side.share:.0%} of {others} (median)"
        elif np.nanmax(eye.series.distance) == np.nanmin(eye.series.distance):
            how = f"does not move: every value is {np.nanmax(eye.series.distance):g}"
        elif eye.blinks:
            how = f"blinks apart from {fellow} ({counted(len(eye.blinks), 'blink')}, none at {others})"
        else:
            how = f"does not move beyond its noise at {others}"
        lines.append(f"{_label(eye)}: {how}; {fellow} was judged separately")
    return lines


def _winks_s(eye: EyeBlinks, rejected: Collection[tuple[str, int]]) -> list[float]:
    """The deepest moments of an eye's winks that are among its blinks and not rejected."""
    if eye.recognised is None:
        return []
    accepted = [blink.minimum_s for blink in eye.blinks if (blink.column, blink.number) not in rejected]
    # Half a frame: the same moment but for rounding.
    within_s = 0.5 / eye.series.fps
    return [wink for wink in eye.recognised.winks_s if any(abs(wink - one) < within_s for one in accepted)]


def _label(eye: EyeBlinks) -> str:
    name = eye_of(eye.series.column)
    return f"{name} eye ({eye.series.column})" if name else eye.series.column


def paired_blinks(left: EyeBlinks, right: EyeBlinks) -> list[tuple[MeasuredBlink, MeasuredBlink]]:
    """Match the blinks of both eyes whose minima lie within the other's blink; each is used once."""
    free = list(right.blinks)
    pairs = []
    for blink in left.blinks:
        for other in free:
            if (
                blink.onset_frame < other.minimum_frame < blink.end_frame
                and other.onset_frame < blink.minimum_frame < other.end_frame
            ):
                pairs.append((blink, other))
                free.remove(other)
                break
    return pairs


def both_eyes(eyes: Sequence[EyeBlinks]) -> list[tuple[MeasuredBlink, MeasuredBlink]]:
    """Return the blinks of the left eye with their partners in the right one; none for other columns."""
    pair = eye_pair([eye.series.column for eye in eyes])
    return [] if pair is None else paired_blinks(eyes[pair[0]], eyes[pair[1]])


def paired_profiles(left: EyeBlinks, right: EyeBlinks, recording: str) -> list[BlinkProfile]:
    """Return the blinks seen in both eyes: earlier onset, later end, the minimum the left eye's."""
    profiles = []
    for number, (blink, other) in enumerate(paired_blinks(left, right), start=1):
        onset = min(blink.onset_frame, other.onset_frame)
        end = max(blink.end_frame, other.end_frame)
        both = [
            closure_at_300(eye.smooth, eye.series.fps, onset, blink.minimum_frame, end, row.closed_distance)
            for eye, row in ((left, blink), (right, other))
        ]
        closure, minimum = both[0]
        profiles.append(
            BlinkProfile(
                profile_id=f"{recording}-both-{number:02d}",
                closure=np.round(closure, 6),
                closure_other=np.round(both[1][0], 6),
                minimum_index=minimum,
                down_frames=minimum,
                up_frames=closure.size - 1 - minimum,
                amplitude=round(float(closure.max()), 6),
                source=f"recorded: {recording}, both eyes, blinks {blink.number} and {other.number}",
                eye="both",
                recording=recording,
                rest_before=round(blink.rest_before, 6),
                rest_after=round(blink.rest_after, 6),
            )
        )
    return profiles


def all_profiles(
    eyes: Sequence[EyeBlinks], recording: str, names: Sequence[Eye | None]
) -> list[BlinkProfile]:
    """Return every eye's profiles, then those of both eyes together where there are two."""
    profiles = [
        profile
        for eye_blinks, name in zip(eyes, names, strict=True)
        for profile in eye_profiles(eye_blinks, recording, name, "one" if len(eyes) == 1 else "")
    ]
    if (pair := left_and_right(names)) is not None:
        left, right = (eyes[k] for k in pair)
        profiles += paired_profiles(left, right, recording)
    return profiles
