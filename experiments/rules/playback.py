"""When the presentation of a clip is uncertain, flagged or failed."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.declaration.base import Declaration

# What happens to a presentation that something disturbed.

Consequence = Literal["ignore", "flag", "repeat"]


class Disturbances(Declaration):
    """What each disturbance does to the presentation: `ignore`, `flag`, or `repeat` (it failed).

    Every disturbance is recorded, whatever its effect. A presentation that a reload or crash interrupted
    always fails.
    """

    full_screen_left: Consequence = "flag"
    """Participant left full screen during the clip, or before its start key."""
    window_too_small: Consequence = "flag"
    """The window became smaller than the clip."""
    clip_cut_off: Consequence = "flag"
    """Part of the clip was outside the window."""
    clip_scaled_down: Consequence = "flag"
    """The clip has no measured size and is wider than the window, so it was shown smaller than its own
    pixels."""
    zoomed: Consequence = "flag"
    """The page was zoomed or moved to another screen, during the clip or before its start key: the size is
    wrong."""
    refresh_dropped: Consequence = "flag"
    """The screen refreshed much less often than before, for example in power-saving mode."""
    scale_reloaded: Consequence = "flag"
    """The page was reloaded after the clip, and the answer was given without a second view."""
    focus_lost: Consequence | None = None
    """The page was hidden or lost focus during the clip. If empty, `fail_on_focus_lost` decides."""


class PlaybackRules(Declaration):
    """When a presentation is uncertain, flagged or failed. Counts are frames of the clip; times are
    milliseconds.

    A presentation that exceeds a `failed_*` limit fails, and its clip is shown again at the end of the block.
    One that exceeds a `flagged_*` limit is flagged. If the animation clock is more uneven than
    `uncertain_unevenness_ms`, it is uncertain: all frames were drawn, but one may not have reached the
    screen. All others are good.

    The limits allow for lateness that leaves a frame visible: 0.9 of the refreshes beyond the first for which
    it stays. If it stays for one refresh only, 0.9 of the rest of that refresh counts. The allowance is never
    more than 0.9 of the frame's duration.
    """

    flagged_missing_frames: Annotated[int, Field(ge=0)] = 0
    """Number of undrawn frames above which a presentation is flagged."""
    failed_missing_frames: Annotated[int, Field(ge=0)] = 3
    """Number of undrawn frames above which a presentation fails."""
    flagged_late_frames: Annotated[int, Field(ge=0)] = 2
    """Number of frames more than one refresh late, above which a presentation is flagged."""
    flagged_longest_gap_ms: Annotated[float, Field(gt=0)] = 70.0
    """Longest time between two drawn frames above which a presentation is flagged, in ms."""
    failed_longest_gap_ms: Annotated[float, Field(gt=0)] = 250.0
    """Longest time between two drawn frames above which a presentation fails, in ms."""
    uncertain_unevenness_ms: Annotated[float, Field(gt=0)] = 3.0
    """Unevenness of the page's animation clock above which a presentation is uncertain, in ms."""
    fail_on_focus_lost: bool = True
    """Whether a presentation fails if the page loses focus or is hidden. Otherwise it is flagged."""
    flag_video_fallback: bool = True
    """Whether to flag presentations by the video element, which reports frames less precisely."""
    disturbances: Disturbances = Disturbances()
    """What each disturbance does to a presentation."""
    max_repeats: Annotated[int, Field(ge=0, le=5)] = 1
    """How often a clip is shown again at the end of the block after its presentation failed."""

    def consequence(self, disturbance: str) -> Consequence:
        """What a disturbance of this name does; one without a key is only recorded."""
        if disturbance == "focus_lost" and self.disturbances.focus_lost is None:
            return "repeat" if self.fail_on_focus_lost else "flag"
        if disturbance not in Disturbances.model_fields:
            return "ignore"
        declared: Consequence = getattr(self.disturbances, disturbance)
        return declared
