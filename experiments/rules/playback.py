"""When a play of a clip is uncertain, flagged or failed."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.declaration.base import Declaration

# What becomes of a play during which something disturbed the view.

Consequence = Literal["ignore", "flag", "repeat"]


class Disturbances(Declaration):
    """What each disturbance of a view does to its play: `ignore`, `flag`, or `repeat` (it is failed).

    Every one is recorded with the view whatever it does. A view that was broken off, by a reload or a crash,
    always fails its play.
    """

    full_screen_left: Consequence = "flag"
    """Full screen was left during the clip, or before its start key."""
    window_too_small: Consequence = "flag"
    """The window became smaller than the clip."""
    clip_cut_off: Consequence = "flag"
    """Less than the whole clip was inside the window."""
    zoomed: Consequence = "flag"
    """The page was zoomed or went to another screen, in the clip or before its start key: a wrong size."""
    refresh_dropped: Consequence = "flag"
    """The screen refreshed much less often than it did before, as a power saver makes it."""
    scale_reloaded: Consequence = "flag"
    """The page was left after the clip and the answer given on a later page, without a second view."""
    focus_lost: Consequence | None = None
    """The page was hidden or lost focus during the clip; where not given, `fail_on_focus_lost` decides."""


class PlaybackRules(Declaration):
    """When a play is uncertain, flagged or failed. Counts are frames of the clip, times are milliseconds.

    A play breaking a `failed_*` limit is failed (its clip is offered again at the end of the block), one
    breaking a `flagged_*` limit is flagged. One whose animation clock ran more unevenly than
    `uncertain_unevenness_ms` is uncertain: all frames were drawn, and one may not have reached the screen.
    What a frame may be late and is still shown comes on top: 0.9 of the refreshes for which it stays beyond
    one, or of what the only one leaves; it is never more than 0.9 of the time for which it stays. Any other
    play is good.
    """

    flagged_missing_frames: Annotated[int, Field(ge=0)] = 0
    """Frames of the clip never drawn, more than which flag a play."""
    failed_missing_frames: Annotated[int, Field(ge=0)] = 3
    """Frames of the clip never drawn, more than which fail a play."""
    flagged_late_frames: Annotated[int, Field(ge=0)] = 2
    """Frames drawn more than one refresh after their time, more than which flag a play."""
    flagged_longest_gap_ms: Annotated[float, Field(gt=0)] = 70.0
    """Longest time between two drawn frames, in ms, over which a play is flagged."""
    failed_longest_gap_ms: Annotated[float, Field(gt=0)] = 250.0
    """Longest time between two drawn frames, in ms, over which a play is failed."""
    uncertain_unevenness_ms: Annotated[float, Field(gt=0)] = 3.0
    """Unevenness of the page's animation clock, in ms, over which a play is uncertain."""
    fail_on_focus_lost: bool = True
    """Whether a play fails where the page lost focus or visibility during it; else it is flagged."""
    flag_video_fallback: bool = True
    """Whether a play by the video element, which reports frames less exactly, is flagged."""
    disturbances: Disturbances = Disturbances()
    """What disturbances of a view do to its play."""
    max_repeats: Annotated[int, Field(ge=0, le=5)] = 1
    """How often a clip whose play failed is offered again, at the end of the block."""

    def consequence(self, disturbance: str) -> Consequence:
        """What a disturbance of this name does; one that no key names is recorded only."""
        if disturbance == "focus_lost" and self.disturbances.focus_lost is None:
            return "repeat" if self.fail_on_focus_lost else "flag"
        if disturbance not in Disturbances.model_fields:
            return "ignore"
        declared: Consequence = getattr(self.disturbances, disturbance)
        return declared
