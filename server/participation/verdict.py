"""The playback verdict of one play, or of several clips, by the declared rules."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from experiments.rules import PlaybackRules
from experiments.rules.playback import Consequence
from server.participation.answer_schemas import IMPOSSIBLE, PlaybackLog, RatingIn, Verdict
from server.participation.versions import PlacedClip

# The playback verdict of one play, by the declared rules: good, uncertain, flagged or failed, and why.
#
# `good` means that every frame was on the screen, within the uncertainty stated in
# docs/explanation/participant.md.
# `uncertain` says that nothing is known against the play, and not enough for it.

Ruling = tuple[Verdict, str]
GOOD: Ruling = ("good", "")
INTERRUPTED = "interrupted"
"""A view that was broken off by a reload or a crash: the play has no answer."""
ASSUMED_REFRESH_HZ = 60.0
SHOWN_SHARE = 0.9
"""A frame counts as seen only if its delay is at most this share of the time it stays on screen, whatever the
study allows (measured by `make scope`, decision 0802)."""
ROUNDING = 0.05
"""60 fps on a screen of 59.9 Hz counts as one refresh per frame."""


@dataclass(frozen=True)
class Playback:
    """What the page measured of one play, over all its views; None where it could not.

    Attributes
    ----------
    frames_seen : int or None
        Different frames in the page's log of drawn frames, see `frames_in_log`.
    clock_gap_ms, clock_late_ms : float or None
        How unevenly the animation clock ran that drew the clip.
    disturbances : mapping of str to int
        How often each disturbed the views, by name.
    """

    method: Literal["webcodecs", "video", "none"]
    clip_sha256: str | None
    frames_drawn: int | None
    frames_late: int | None
    frames_missing: int | None
    longest_gap_ms: float | None
    focus_lost: bool | None
    frames_seen: int | None = None
    refresh_rate_hz: float | None = None
    clock_gap_ms: float | None = None
    clock_late_ms: float | None = None
    disturbances: Mapping[str, int] = field(default_factory=dict)


# Decision 0351: The verdict is about what was shown.
def judge(
    rules: PlaybackRules,
    playback: Playback,
    clip_sha256: str | None,
    frames: int,
    fps: float,
    *,
    rated: bool,
) -> Ruling:
    """The verdict on one play and the rule that gave it.

    Parameters
    ----------
    rules : PlaybackRules
        As declared.
    playback : Playback
        As measured.
    clip_sha256 : str or None
        Of the clip assigned, None for trials without one.
    frames : int
        That should have been drawn, over all views.
    fps : float
        Of the clip, in frames a second.
    rated : bool
        False where no rating could be given.
    """
    if clip_sha256 is None:
        return GOOD if rated else ("failed", "not_rated")
    # From the plainest cause to the subtlest: the first that holds is the one that is reported.
    if playback.disturbances.get(INTERRUPTED):
        return "failed", INTERRUPTED
    if playback.method == "none":
        return "failed", "clip_not_played"
    if playback.clip_sha256 != clip_sha256:
        return "failed", "wrong_clip"
    failed = _failing_rule(rules, playback)
    if failed or not rated:
        return "failed", failed or "not_rated"
    flagged = _flagging_rule(rules, playback, frames)
    if flagged:
        return "flagged", flagged
    # Last, as it speaks of what could not be seen: any fault that was seen says more.
    uncertain = _uncertainty(rules, playback, fps)
    return ("uncertain", uncertain) if uncertain else GOOD


def _failing_rule(rules: PlaybackRules, playback: Playback) -> str:
    # What was not measured fails nothing here: a missing log is flagged by a rule of its kind below.
    if (playback.frames_missing or 0) > rules.failed_missing_frames:
        return "failed_missing_frames"
    if (playback.longest_gap_ms or 0) > rules.failed_longest_gap_ms:
        return "failed_longest_gap_ms"
    return _disturbance_with(rules, playback, "repeat")


def _disturbance_with(rules: PlaybackRules, playback: Playback, consequence: Consequence) -> str:
    """The first disturbance of the play that has this consequence; empty where none has."""
    # A page's own count of lost focus, where it sends one, takes the place of the flag.
    counts = {"focus_lost": int(bool(playback.focus_lost)), **playback.disturbances}
    named = (name for name, count in counts.items() if count and rules.consequence(name) == consequence)
    return next(named, "")


def _flagging_rule(rules: PlaybackRules, playback: Playback, frames: int) -> str:
    if disturbed := _disturbance_with(rules, playback, "flag"):
        return disturbed
    if (playback.frames_missing or 0) > rules.flagged_missing_frames:
        return "flagged_missing_frames"
    if (playback.frames_late or 0) > rules.flagged_late_frames:
        return "flagged_late_frames"
    if (playback.longest_gap_ms or 0) > rules.flagged_longest_gap_ms:
        return "flagged_longest_gap_ms"
    if playback.disturbances.get(IMPOSSIBLE):
        return IMPOSSIBLE
    # The element's log is not compared: its callbacks miss frames that were shown.
    if playback.method == "video":
        return "video_fallback" if rules.flag_video_fallback else ""
    if playback.frames_missing is None or playback.frames_seen is None:
        return "no_frame_log"
    # The counts are the page's own; its log of drawn frames must agree.
    return "" if frames - playback.frames_seen == playback.frames_missing else "frame_log_disagrees"


def _uncertainty(rules: PlaybackRules, playback: Playback, fps: float) -> str:
    if playback.method == "video":
        return "video_fallback"
    unevenness_ms = _unevenness_ms(playback)
    if unevenness_ms is None:
        return "no_clock_record"
    limit_ms = _limit_ms(rules.uncertain_unevenness_ms, playback.refresh_rate_hz, fps)
    return "uncertain_unevenness_ms" if unevenness_ms > limit_ms else ""


def _unevenness_ms(playback: Playback) -> float | None:
    """By how much the animation clock was later than even, at the worst."""
    if playback.clock_gap_ms is None or playback.clock_late_ms is None:
        return None
    # A gap between two callbacks holds one refresh anyway; only what is beyond it is unevenness.
    return max(playback.clock_gap_ms - _refresh_ms(playback.refresh_rate_hz), playback.clock_late_ms)


def _limit_ms(allowed_ms: float, refresh_rate_hz: float | None, fps: float) -> float:
    """The greatest delay at which a frame is still seen.

    It is the allowed delay (at most 90% of a refresh) plus 90% of each refresh after the first. A frame that
    stays for one refresh may always be delayed by 90% of it, because pages draw so that no picture waits for
    the screen. If the refresh rate is unknown, 60 Hz is assumed, and only the allowed delay counts for a
    frame of one refresh, because the screen may be faster.
    """
    refresh_ms = _refresh_ms(refresh_rate_hz)
    refreshes = max(1, _refreshes(refresh_rate_hz, fps))
    if refreshes == 1 and refresh_rate_hz is not None:
        return SHOWN_SHARE * refresh_ms
    return min(allowed_ms, SHOWN_SHARE * refresh_ms) + SHOWN_SHARE * (refreshes - 1) * refresh_ms


def _refreshes(refresh_rate_hz: float | None, fps: float) -> int:
    return int(1000 / fps / _refresh_ms(refresh_rate_hz) + ROUNDING)


def _refresh_ms(refresh_rate_hz: float | None) -> float:
    return 1000 / (refresh_rate_hz or ASSUMED_REFRESH_HZ)


def frames_in_log(indices: Iterable[int]) -> int:
    """Different frames drawn, counted separately per view: an index below the one before begins a view."""
    seen, latest, in_view = 0, -1, set[int]()
    for index in indices:
        # Frames of one view only ever increase, so that a smaller index is the next view's.
        if index < latest:
            seen, in_view = seen + len(in_view), set()
        in_view.add(index)
        latest = index
    return seen + len(in_view)


def is_settled(kind: str, play: int, verdict: str, max_repeats: int) -> bool:
    """True where this play ends its trial; a failed main play is repeated while repeats are left."""
    return kind != "main" or verdict != "failed" or play > max_repeats


# What a page's log says of one play, and the verdict on a play of several clips.


def playback_of(log: PlaybackLog) -> Playback:
    """What a log says of one play."""
    seen = frames_in_log(index for index, _ in log.drawn) if log.drawn is not None else None
    return Playback(
        method=log.method,
        clip_sha256=log.clip_sha256,
        frames_drawn=log.frames_drawn,
        frames_late=log.frames_late,
        frames_missing=log.frames_missing,
        longest_gap_ms=log.longest_gap_ms,
        focus_lost=bool(log.focus_lost),
        frames_seen=seen,
        refresh_rate_hz=log.refresh_rate_hz,
        clock_gap_ms=log.clock_gap_ms,
        clock_late_ms=log.clock_late_ms,
        disturbances=log.disturbances or {},
    )


def judge_several(
    rules: PlaybackRules, assigned: "Mapping[str, PlacedClip]", frames: int, rating: RatingIn
) -> Ruling:
    """The verdict on a play of several clips: each must be there, and every frame of each.

    Parameters
    ----------
    rules : PlaybackRules
        As declared.
    assigned : mapping of str to PlacedClip
        The clips of the trial by role.
    frames : int
        That the log of drawn frames should hold. Clips at once are drawn by one clock: a frame of the log is
        one of each clip, and the longest counts. In turn the log has one clip after the other.
    rating : RatingIn
        The play as the page sent it.
    """
    shown = rating.playback.clips.by_role() if rating.playback.clips else {}
    hashes = {role: one.clip_sha256 for role, one in shown.items()}
    if rating.playback.method != "none" and hashes != {role: clip.sha256 for role, clip in assigned.items()}:
        return "failed", "wrong_clip"
    first = next(iter(assigned.values()))
    playback = replace(playback_of(rating.playback), clip_sha256=first.sha256)
    # The fastest's frames stay for the shortest time, and the clock is known of all clips together.
    fps = max(clip.fps for clip in assigned.values())
    ruling = judge(rules, playback, first.sha256, frames, fps, rated=rating.answer.given)
    counted = {role: one.frames_drawn + one.frames_missing for role, one in shown.items()}
    if ruling[0] != "good" or counted == {role: clip.frames for role, clip in assigned.items()}:
        return ruling
    return "flagged", "frame_log_disagrees"
