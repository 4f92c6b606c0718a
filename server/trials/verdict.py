"""The playback verdict of one play, by the declared rules: good, flagged, or failed with the rule's name."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from experiments.rules import PlaybackRules

Verdict = Literal["good", "flagged", "failed"]
Ruling = tuple[Verdict, str]
GOOD: Ruling = ("good", "")


@dataclass(frozen=True)
class Playback:
    """What the page measured of one play, over all its views; None where it could not.

    frames_seen: different frames in the page's log of drawn frames, see `frames_in_log`.
    """

    method: Literal["webcodecs", "video", "none"]
    clip_sha256: str | None
    frames_drawn: int | None
    frames_late: int | None
    frames_missing: int | None
    longest_gap_ms: float | None
    focus_lost: bool | None
    frames_seen: int | None = None


def judge(
    rules: PlaybackRules, playback: Playback, clip_sha256: str | None, frames: int, *, rated: bool
) -> Ruling:
    """The verdict on one play and the rule that gave it.

    Parameters
    ----------
    rules: as declared. playback: as measured.
    clip_sha256: of the clip assigned, None for trials without one.
    frames: that should have been drawn, over all views. rated: False where no rating could be given.
    """
    if clip_sha256 is None:
        return GOOD if rated else ("failed", "not_rated")
    if playback.method == "none":
        return "failed", "clip_not_played"
    if playback.clip_sha256 != clip_sha256:
        return "failed", "wrong_clip"
    failed = _failed(rules, playback)
    if failed or not rated:
        return "failed", failed or "not_rated"
    flagged = _flagged(rules, playback, frames)
    return ("flagged", flagged) if flagged else GOOD


def _failed(rules: PlaybackRules, playback: Playback) -> str:
    if (playback.frames_missing or 0) > rules.failed_missing_frames:
        return "failed_missing_frames"
    if (playback.longest_gap_ms or 0) > rules.failed_longest_gap_ms:
        return "failed_longest_gap_ms"
    return "focus_lost" if playback.focus_lost and rules.fail_on_focus_lost else ""


def _flagged(rules: PlaybackRules, playback: Playback, frames: int) -> str:
    if playback.focus_lost:
        return "focus_lost"
    if (playback.frames_missing or 0) > rules.flagged_missing_frames:
        return "flagged_missing_frames"
    if (playback.frames_late or 0) > rules.flagged_late_frames:
        return "flagged_late_frames"
    if (playback.longest_gap_ms or 0) > rules.flagged_longest_gap_ms:
        return "flagged_longest_gap_ms"
    if playback.method == "video":
        return "video_fallback" if rules.flag_video_fallback else ""
    if playback.frames_missing is None or playback.frames_seen is None:
        return "no_frame_log"
    # The counts are the page's own; its log of drawn frames must tell the same.
    return "" if frames - playback.frames_seen == playback.frames_missing else "frame_log_disagrees"


def frames_in_log(indices: Iterable[int]) -> int:
    """Different frames drawn, each view counted for itself: an index below the one before begins a view."""
    seen, latest, in_view = 0, -1, set[int]()
    for index in indices:
        if index < latest:
            seen, in_view = seen + len(in_view), set()
        in_view.add(index)
        latest = index
    return seen + len(in_view)


def is_settled(kind: str, play: int, verdict: str, max_repeats: int) -> bool:
    """True where this play ends its trial; a failed main play is repeated while repeats are left."""
    return kind != "main" or verdict != "failed" or play > max_repeats
