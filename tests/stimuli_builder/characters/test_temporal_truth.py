"""Faces that ship, as sequences: what no blink moves stands still; what moves neither pops nor flickers."""

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.frames import FramePainter
from stimuli_builder.clips.geometry import Geometry
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet

NAMES = sorted(json.loads((Path(__file__).parent / "shipped.json").read_text()))


@dataclass(frozen=True, eq=False)
class Face:
    """A face's levels at its own size, eyes or whole face, and their luma (of green, 0-255) in the window."""

    levels: LevelSet
    geometry: Geometry
    luma: NDArray[np.float32]

    @property
    def eyes(self) -> tuple[float, float]:
        """Columns in px of the eyes' middles."""
        middle, apart = self.geometry.size_px[0] / 2, self.px(self.geometry.inter_ocular_mm)
        return middle - apart / 2, middle + apart / 2

    def px(self, mm: float) -> float:
        """Pixels of so many mm."""
        return mm * self.geometry.px_per_mm


@pytest.fixture(scope="module", params=NAMES)
def face(request: pytest.FixtureRequest) -> Face:
    character = find_character(request.param)
    levels = character.levels(character.geometry.size_px)
    return Face(levels, character.geometry, 255 * GAMMA[levels.levels[..., 1]])


def test_brows_nose_and_edges_stand_still_to_the_bit(face: Face) -> None:
    closing = np.concatenate([np.zeros(20), np.linspace(0, 1, 45), np.linspace(1, 0, 75), np.zeros(20)])
    frames = np.stack(list(FramePainter(face.levels).frames(ClipCurve(closing, 20), 30, blur=True)))
    luma = frames[:, : face.geometry.size_px[1]]
    assert np.ptp(luma.astype(int), axis=0).max() > 50
    still = np.ones(luma.shape[1:], bool)
    for eye in face.eyes:
        still[slice(*face.geometry.blink_rows), round(eye - face.px(25)) : round(eye + face.px(25))] = False
    nose = face.geometry.size_px[0] / 2
    still[:, round(nose - face.px(9)) : round(nose + face.px(9))] = True
    assert still.mean() > 0.35
    assert not np.ptp(luma[:, still].astype(int), axis=0).any()


def test_no_level_pops(face: Face) -> None:
    steps = np.abs(np.diff(face.luma, axis=0))
    size = steps.mean(axis=(1, 2))
    around = [np.median(np.r_[size[max(0, k - 3) : k], size[k + 1 : k + 4]]) for k in range(len(size))]
    # A level that is out of line doubles the steps to it and from it.
    assert (size / around).max() < 1.7
    # No patch of 1 mm changes between neighbors by more than a lash does that passes it.
    patch = round(face.px(1.05))
    assert max(float(cv2.blur(step, (patch, patch)).max()) for step in steps) < 45


def test_noise_neither_flickers_nor_sticks(face: Face) -> None:
    # A pixel that is covered once changes there and back at most; what it changes more is noise.
    change = np.abs(np.diff(face.luma, axis=0)).sum(axis=0)
    whole = np.ptp(face.luma, axis=0)
    per_level = np.maximum(change - 2 * whole, 0)[whole > 2] / len(face.luma)
    assert per_level.mean() < 0.25


def test_the_lid_covers_the_catchlight_once(face: Face) -> None:
    window = face.levels.window
    for eye in face.eyes:
        column = eye - window.x
        iris = face.luma[:, :, round(column - face.px(4)) : round(column + face.px(4))]
        size = round(face.px(4))
        raised = iris[0] - cv2.blur(iris[0], (size, size))  # lit skin may be as bright as a catchlight
        spot = raised > 0.7 * raised.max()
        assert spot.sum() > 10
        shown = iris[:, spot].mean(axis=1) / iris[0, spot].mean()
        # The skin of a light lid has up to three quarters of the light that it covers, its lashes less.
        covered = int(np.argmax(shown < 0.7))
        assert 0 < covered < 100
        assert shown[: covered // 2].min() > 0.8
        # Lashes that pass may dim it for a while, by no more than this.
        assert (shown[:covered] - np.minimum.accumulate(shown[:covered])).max() < 0.2
        assert shown[covered:].max() < 0.85
