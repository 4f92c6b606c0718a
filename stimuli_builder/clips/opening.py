"""How far each eye is open in a picture, measured against the character's own levels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.manifest import Clip
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.frames import SEAM_MM, eye_light, same_picture
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.motion_blur import frame_windows

Array = NDArray[np.float64]
STEP_PX = 3
"""Every third pixel both ways tells enough."""


@dataclass(frozen=True, eq=False)
class _Eye:
    """One half of the window: its luma projected on open minus closed gives a number that falls with closure.

    A table of that number over the character's levels, turned round, gives the closure of any picture.
    """

    left_eye: bool
    columns: slice
    closed: Array
    template: Array
    table: Array

    def project(self, luma: Array) -> float:
        """The number of a (h, w) window's luma."""
        return float(np.sum((luma[:, self.columns] - self.closed) * self.template))


class OpeningMeter:
    """Measures both eyes of a picture, each on its own side, and says what a clip's curves promise there.

    A frame with motion blur is a mean of light, and a lower lid that moves changes the projection too. So the
    promised number is that of the frame which the curves describe, blended as the clip builder blends it;
    both numbers are compared as mm of opening.
    """

    def __init__(self, character: LevelSet, opening_mm: float) -> None:
        self._character, self._opening_mm = character.thinned(STEP_PX), opening_mm
        rows, columns = character.window.slices
        self._pixels = slice(rows.start, rows.stop, STEP_PX), slice(columns.start, columns.stop, STEP_PX)
        self._eyes = _eyes(self._character)

    def measured_mm(self, luma: NDArray[np.uint8]) -> Array:
        """(frames, eyes) opening in mm in pictures of (frames, height, width) limited-range luma."""
        pictures = (luma[:, *self._pixels].astype(np.float64) - 16) / 219
        return self._opening([[eye.project(picture) for eye in self._eyes] for picture in pictures])

    def promised_mm(self, clip: Clip) -> Array:
        """(frames, eyes) opening in mm that each frame of a clip should measure, from its curves.

        Raises
        ------
        InputError
            The clip's curves do not fit one another or the character.
        """
        curve = _curve_of(clip)
        if curve.lower_vertical_mm is not None and self._character.read_lower is None:
            raise InputError("its lower lid moves, its character's does not")
        known: dict[bytes, list[float]] = {}
        rows = []
        blur = clip.inputs.get("motion_blur") != "false"
        for samples, weights in frame_windows(len(curve.closure), clip.fps, blur):
            key = same_picture(curve, samples, weights)
            if key not in known:
                known[key] = self._promised(curve, samples, weights)
            rows.append(known[key])
        return self._opening(rows)

    def _promised(self, curve: ClipCurve, samples: NDArray[np.int64], weights: Array) -> list[float]:
        luma = _luma(eye_light(self._character, curve, curve.closure, samples, weights))
        other = luma
        if curve.closure_other is not None:
            other = _luma(eye_light(self._character, curve, curve.closure_other, samples, weights))
        return [eye.project(luma if eye.left_eye else other) for eye in self._eyes]

    def _opening(self, projected: list[list[float]]) -> Array:
        closures = self._character.closures[::-1]
        columns = [
            np.interp(values, eye.table[::-1], closures)
            for eye, values in zip(self._eyes, np.array(projected).T, strict=True)
        ]
        return np.asarray(self._opening_mm * (1 - np.stack(columns, axis=-1)), np.float64)


def _eyes(character: LevelSet) -> list[_Eye]:
    """The halves of the thinned window in which a blink shows, without the seam between them."""
    window = character.window
    from_middle = window.x + np.arange(0, window.width, STEP_PX) + 0.5 - character.size_px[0] / 2
    seam_px = SEAM_MM / 2 * character.px_per_mm
    # The participant sees the character's left eye at the right.
    halves = {False: from_middle < -seam_px, True: from_middle > seam_px}
    levels = [_luma(level.astype(np.float32)) for level in character.levels]
    eyes = []
    for left_eye, half in halves.items():
        where = np.flatnonzero(half)
        columns = slice(int(where[0]), int(where[-1]) + 1) if len(where) else slice(0, 0)
        opened, closed = levels[0][:, columns], levels[-1][:, columns]
        energy = float(np.sum((opened - closed) ** 2))
        if energy > 0:
            template = (opened - closed) / energy
            table = np.array([np.sum((level[:, columns] - closed) * template) for level in levels])
            # Equal steps could not be turned round.
            table = np.minimum.accumulate(table - 1e-9 * np.arange(len(table)))
            eyes.append(_Eye(left_eye, columns, closed, template, table))
    return eyes


def _curve_of(clip: Clip) -> ClipCurve:
    def signal(values: tuple[float, ...]) -> Array | None:
        return np.asarray(values) if values else None

    return ClipCurve(
        closure=np.asarray(clip.closure),
        onset_sample=0,
        profile_id=clip.profile,
        closure_other=signal(clip.closure_other),
        lower_vertical_mm=signal(clip.lower_vertical_mm),
        lower_horizontal_mm=signal(clip.lower_horizontal_mm),
    )


def _luma(light: NDArray[np.floating]) -> Array:
    """Luma in 0-1 of 16-bit linear light (h, w, 3)."""
    code = GAMMA[np.clip(np.round(light), 0, 65535).astype(np.int64)]
    return np.asarray(code @ np.array([0.2126, 0.7152, 0.0722]), np.float64)
