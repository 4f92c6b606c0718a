"""How a clip must appear, and what the device must offer."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration

PHONE_PX = ((390, 660), (840, 340))
"""Room of a page on a usual phone, upright and on its side, in CSS pixels."""


class Display(Declaration):
    """How the clip must appear: size on the screen, surround, and what the device must offer."""

    inter_ocular_mm: Annotated[float, Field(gt=0, le=500)] = 60.0
    """Distance between the eyes' centres on the screen, in mm; calibration turns it into pixels."""
    calibrate: Literal["required", "optional", "off"] = "required"
    """Whether the participant fits a card's outline to learn the screen's pixels per mm. Without it clips are
    shown pixel by pixel and `px_per_mm` is empty in the data."""
    calibration_repeats: Annotated[int, Field(ge=2, le=6)] = 2
    """How often the size is measured, each time from another one; what differs too much is measured up to
    twice more. The spread of the repeats is `calibration_spread` in the data."""
    recheck_size: bool = False
    """Asks for one more measurement in each break; one that differs by more than 4% leads to a new
    calibration."""
    viewing_distance: bool = False
    """Adds the blind-spot test, which estimates `viewing_distance_mm` from where a dot vanishes."""
    right_to_left_scales: Literal["mirrored", "same"] = "mirrored"
    """Where a language is read from right to left: whether scales run that way too, their lowest point on the
    right, or stay as in the other languages. Digits answer alike, arrow keys follow what is seen."""
    full_screen: bool = True
    """Asks for full screen before the first trial and again where it was left."""
    background: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")] = "#808080"
    """Colour of the page around the clip."""
    minimum_width_px: Annotated[int, Field(ge=0)] = 800
    """Smallest window width, in CSS pixels, in which a run may begin."""
    minimum_height_px: Annotated[int, Field(ge=0)] = 500
    """Smallest window height, in CSS pixels, in which a run may begin."""
    allow_touch: bool = True
    """Lets in devices that have a touch screen and no mouse, phones and tablets. Off: turns them away."""
    sync_patch: bool = False
    """Draws a square into the clip's lower left corner that codes the frame's number, for a photodiode or a
    phone's film (`stimuli scope`). For measuring a set-up, not for participants."""

    @property
    def turned_away(self) -> str:
        """Which devices can take no part, in a sentence; empty where phones can."""
        needed = (self.minimum_width_px, self.minimum_height_px)
        if not self.allow_touch:
            return (
                "Phones and tablets are turned away: devices with a touch screen and no mouse are not let in."
            )
        if any(needed[0] <= width and needed[1] <= height for width, height in PHONE_PX):
            return ""
        (width, height), _ = PHONE_PX
        return (
            f"Phones are turned away: a window of at least {needed[0]} x {needed[1]} px is asked for, and a "
            f"phone has about {width} x {height}. Minimum width and height are under Screen and playback."
        )
