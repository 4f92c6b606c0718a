"""Where the picture lies on the face, and what of it a blink changes. Lengths in cm of the kit."""

from dataclasses import dataclass

import numpy as np

from experiments.errors import InputError
from face_baking.kit import Array

INTER_OCULAR_MM = 60.0
DISTANCE_CM = 65.0
PLANE_Z_CM = 9.0
_BOX_MARGIN_MM, _FEATHER_MM = 1.6, 1.4
_NOSE_MM = 9.2
"""Half width of the bridge of the nose, which no blink changes: its renders differ by noise and shade."""
Box = tuple[int, int, int, int]
"""x, y, width, height in px, from the upper left."""


@dataclass(frozen=True)
class Framing:
    """What a named framing shows: mm at the declared inter-ocular distance, and its size in px."""

    width_mm: float
    above_eyes_mm: float
    size_px: tuple[int, int]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    """Box of the kit's faces that are needed, cm."""
    levels: int
    """Rounds of subdivision."""
    shows: str = ""
    """What a label says of the framing."""


FRAMINGS = {
    "eyes": Framing(128.0, 4.3, (960, 360), (-9, -0.5, 0), (9, 8.5, 99), 3),
    "face": Framing(128.0, -36.0, (720, 900), (-99, -99, -7), (99, 99, 99), 2, "forehead to chin"),
}


@dataclass(frozen=True)
class View:
    """A camera in front of the eyes' middle that shows `width_cm` across at `PLANE_Z_CM`."""

    width_cm: float
    centre_y_cm: float
    size_px: tuple[int, int]
    mm_per_cm: float
    """Declared millimeters per centimetre of the kit: 10 if the eyes were 60 mm apart."""

    @classmethod
    def of(cls, framing: Framing, size_px: tuple[int, int], left_eye: Array, right_eye: Array) -> "View":
        """The view in which the eyes lie `INTER_OCULAR_MM` apart."""
        mm_per_cm = INTER_OCULAR_MM / float(np.linalg.norm(left_eye - right_eye))
        middle = float(left_eye[1] + right_eye[1]) / 2
        return cls(
            framing.width_mm / mm_per_cm, middle + framing.above_eyes_mm / mm_per_cm, size_px, mm_per_cm
        )

    @property
    def px_per_mm(self) -> float:
        """Scale in declared mm."""
        return self.size_px[0] / (self.width_cm * self.mm_per_cm)

    def project(self, points: Array) -> Array:
        """(n, 2) pixel positions of (n, 3) points; pixel 0 spans 0 to 1."""
        width, height = self.size_px
        scale = DISTANCE_CM / (PLANE_Z_CM + DISTANCE_CM - points[..., 2]) * width / self.width_cm
        x = points[..., 0] * scale + width / 2
        return np.stack([x, height / 2 - (points[..., 1] - self.centre_y_cm) * scale], -1)

    def box_round(self, points: Array) -> Box:
        """The smallest box round points with room for soft shadows, inside the frame."""
        at = self.project(points)
        margin = _BOX_MARGIN_MM * self.px_per_mm
        left, top = np.maximum(np.floor(at.min(0) - margin), 0).astype(int)
        right, bottom = np.minimum(np.ceil(at.max(0) + margin), self.size_px).astype(int)
        return int(left), int(top), int(right - left), int(bottom - top)

    def feather(self, box: Box) -> np.ndarray:
        """(h, w, 1) weight of a box's picture over the still frame: 0 on its rim, 1 inside."""
        ramp = max(_FEATHER_MM * self.px_per_mm, 1.0)
        insets = [np.minimum(np.arange(length), np.arange(length)[::-1]) for length in (box[3], box[2])]
        from_nose = np.abs(box[0] + np.arange(box[2]) - self.size_px[0] / 2) - _NOSE_MM * self.px_per_mm
        insets[1] = np.minimum(insets[1], from_nose)
        sides = [0.5 - 0.5 * np.cos(np.pi * np.clip(inset / ramp, 0, 1)) for inset in insets]
        return np.outer(*sides)[..., None].astype(np.float32)


def bounding_box(boxes: list[Box]) -> Box:
    """Smallest box that holds all."""
    left, top = min(b[0] for b in boxes), min(b[1] for b in boxes)
    right, bottom = max(b[0] + b[2] for b in boxes), max(b[1] + b[3] for b in boxes)
    return left, top, right - left, bottom - top


def parse_size(text: str | None, framing: str) -> tuple[int, int]:
    """(width, height) of a size written as 960x360; the framing's own where none is given.

    Raises
    ------
    InputError
        There is no such framing, or the size is none or has another shape than the framing.
    """
    if framing not in FRAMINGS:
        raise InputError(f"framing must be one of {', '.join(FRAMINGS)}; it is '{framing}'")
    own = FRAMINGS[framing].size_px
    if text is None:
        return own
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()) or not 240 <= int(width) <= 3840:
        raise InputError(
            f"size must be WIDTHxHEIGHT in px such as {own[0]}x{own[1]} (240-3840 wide); it is '{text}'"
        )
    size = int(width), int(height)
    if not 0.8 <= size[1] / size[0] * own[0] / own[1] <= 1.25:
        raise InputError(
            f"size {text} does not fit the framing '{framing}': expected about {own[0]}:{own[1]}"
        )
    return size
