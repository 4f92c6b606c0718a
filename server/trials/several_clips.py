"""What a page's log says of one play, and the verdict on a play of several clips."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from experiments.rules import PlaybackRules
from server.trials.schemas import PlaybackLog, RatingIn
from server.trials.verdict import Playback, Ruling, frames_in_log, judge

if TYPE_CHECKING:
    from server.versions import PlacedClip


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
