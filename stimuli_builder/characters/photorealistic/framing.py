"""Where the picture lies on the face: 128 mm wide at the pupils' plane, seen from 650 mm."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

WIDTH_MM, CENTRE_Y_MM, PLANE_Z_MM, DISTANCE_MM = 128.0, 3.5, 10.0, 650.0
INTER_OCULAR_MM = 60.0
# What a blink, and what the lower lid, may change round each eye: x from the eye's centre and y, in mm.
_BLINK_MM = (-19.0, 19.2, -13.4, 15.2)
_LOWER_LID_MM = (-19.0, 19.2, -13.4, 2.6)
_FEATHER_MM = 1.4

Box = tuple[int, int, int, int]


@dataclass(frozen=True)
class Frame:
    """A picture size, and its boxes as x, y, width, height in px."""

    width_px: int
    height_px: int

    @property
    def px_per_mm(self) -> float:
        """Scale in the plane of the pupils."""
        return self.width_px / WIDTH_MM

    def eye_boxes(self) -> dict[str, Box]:
        """What a blink may change, left eye of the picture first."""
        return {"left": self._box(-1, _BLINK_MM), "right": self._box(1, _BLINK_MM)}

    def lower_lid_boxes(self) -> dict[str, Box]:
        """What a lower lid may change."""
        return {"left": self._box(-1, _LOWER_LID_MM), "right": self._box(1, _LOWER_LID_MM)}

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) pixel position, fractional, of (n, 3) points in mm; pixel 0 spans 0 to 1."""
        scale = DISTANCE_MM / (PLANE_Z_MM + DISTANCE_MM - points[:, 2]) * self.px_per_mm
        x = points[:, 0] * scale + self.width_px / 2
        return np.stack([x, self.height_px / 2 - (points[:, 1] - CENTRE_Y_MM) * scale], -1)

    def _box(self, side: int, extent_mm: tuple[float, float, float, float]) -> Box:
        nasal, temporal, bottom, top = extent_mm
        edges = side * (INTER_OCULAR_MM / 2 + np.array([nasal, temporal]))
        left, right = np.round(np.sort(edges) * self.px_per_mm + self.width_px / 2).astype(int)
        upper, lower = np.round(self.height_px / 2 - (np.array([top, bottom]) - CENTRE_Y_MM) * self.px_per_mm)
        upper, lower = max(int(upper), 0), min(int(lower), self.height_px)
        return int(left), upper, int(right - left), lower - upper

    def feather(self, box: Box) -> NDArray[np.float32]:
        """(h, w, 1) weight of a box's picture over the still frame: 0 on its rim, 1 inside."""
        ramp = max(_FEATHER_MM * self.px_per_mm, 1.0)
        sides = []
        for length in (box[3], box[2]):
            inset = np.minimum(np.arange(length), np.arange(length)[::-1])
            sides.append(0.5 - 0.5 * np.cos(np.pi * np.clip(inset / ramp, 0, 1)))
        return np.outer(*sides)[..., None].astype(np.float32)


def parse_size(text: str) -> Frame:
    """Frame of a size written as 960x360."""
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()) or not (240 <= int(width) <= 3840) or int(height) < 200:
        raise InputError(f"size must be WIDTHxHEIGHT in px such as 960x360 (240-3840 wide); it is '{text}'")
    frame = Frame(int(width), int(height))
    if frame.height_px < 30.6 * frame.px_per_mm:
        raise InputError(
            f"size {text} is too flat: the eyes need a height of {round(30.6 * frame.px_per_mm)} px"
        )
    return frame


def bounding_box(boxes: list[Box]) -> Box:
    """Smallest box that holds all."""
    left, top = min(b[0] for b in boxes), min(b[1] for b in boxes)
    right, bottom = max(b[0] + b[2] for b in boxes), max(b[1] + b[3] for b in boxes)
    return left, top, right - left, bottom - top
