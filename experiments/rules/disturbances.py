"""What becomes of a play during which something disturbed the view."""

from typing import Literal

from experiments.base import Declaration

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
