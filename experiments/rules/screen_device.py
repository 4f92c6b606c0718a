"""Screening by the device."""

from typing import Literal

from experiments.base import Declaration


class ScreenDevice(Declaration):
    """Screen out where browser, screen or window cannot show the clips as [display] asks.

    Without this rule the page explains what is missing, and the link stays open for another device.
    """

    rule: Literal["device"] = "device"
    """Names this rule."""
