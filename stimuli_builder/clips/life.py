"""Motion between blinks: head sway, breathing, tremor, gaze, pupil and sensor noise, seeded and measured.

A picture is warped in linear light: the whole frame by the head, the eyes also by gaze and pupil. Blinks stay
as they are; between them the lids follow the gaze.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import DECIMALS, Array, generator

LIFE_VERSION = 1
"""Raise this if the same seed gives other motion."""
SWAY_HZ = (0.1, 0.95)
"""Slowest and fastest part of head sway: below 1 Hz, as in talking heads."""
SWAY_MM = (0.42, 0.36)
"""SD of head sway across and along the face at strength 1: 0.2 to 0.7 mm within 2 s in five real clips."""
ROLL_DEG = 0.12
BREATHING_HZ, BREATHING_MM = 0.25, 0.15
"""Fifteen breaths a minute lift the head a little."""
TREMOR_HZ, TREMOR_MM = (6.0, 11.0), 0.055
"""Physiological tremor of head and camera. With the sway, a frame at 30 fps moves by 0.11 mm on average;
five real clips move by 0.09 to 0.29 mm."""
MM_PER_DEG = 0.2
"""An eye that turns by one degree moves its iris so far (radius of the globe times one degree)."""
DRIFT_DEG = 0.15
SHIFT_DEG, SHIFT_EVERY_S = 1.5, (0.8, 3.5)
"""Gaze shifts of a person who looks at somebody: SD of the landing places, and the time between two."""
SACCADE_S, SACCADE_S_PER_DEG = 0.021, 0.0022
"""Duration of a saccade: 21 ms and 2.2 ms per degree (main sequence; Carpenter 1988)."""
PUPIL_SHARE, PUPIL_HZ = 0.04, (0.05, 0.5)
"""SD of the pupil's radius as a share of it, and the rates of hippus."""
PUPIL_MM = 2.2
NOISE_CODES = 0.35
"""SD of sensor noise in luma, in steps of 8-bit video: 0.32 where a real clip of a talking head is flat."""
PARTS_OF_SWAY = 24
SHARP_PX = 1.5
"""Motion within a frame below this needs no averaging of several pictures."""
WARPS_PER_FRAME = 3


@dataclass(frozen=True, eq=False)
class Life:
    """What moves in addition to blinks, at 300 fps.

    Attributes
    ----------
    head_mm : float64 array (n, 2)
        To the participant's right, and down.
    roll_deg : float64 array (n,)
        Clockwise.
    gaze_mm : float64 array (n, 2)
        How far the irises move within the eyes, to the right and down.
    pupil : float64 array (n,)
        Radius, as a share of its mean, minus 1.
    noise_seed : int
    noise_codes : float
        SD of sensor noise in steps of 8-bit luma.
    """

    head_mm: Array
    roll_deg: Array
    gaze_mm: Array
    pupil: Array
    noise_seed: int
    noise_codes: float

    def __len__(self) -> int:
        return len(self.roll_deg)


def draw_life(sample_count: int, strength: float, seed: int) -> Life:
    """Draw the motion of one clip.

    Parameters
    ----------
    sample_count : int
        Samples at 300 fps.
    strength : float
        0 none, 1 as in recordings of real people; all amplitudes are proportional to it.
    seed : int

    Returns
    -------
    Life
    """
    rng = generator("life", LIFE_VERSION, seed)
    time_s = np.arange(sample_count) / PROFILE_FPS
    head = np.stack([sd * _wavering(rng, time_s, SWAY_HZ) for sd in SWAY_MM], axis=1)
    breath = np.sin(2 * np.pi * (BREATHING_HZ * rng.uniform(0.85, 1.15) * time_s + rng.uniform()))
    head[:, 1] += np.sqrt(2) * BREATHING_MM * breath
    head += TREMOR_MM * np.stack([_wavering(rng, time_s, TREMOR_HZ) for _ in range(2)], axis=1)
    return Life(
        head_mm=strength * head,
        roll_deg=strength * ROLL_DEG * _wavering(rng, time_s, SWAY_HZ),
        gaze_mm=strength * MM_PER_DEG * _gaze_deg(rng, time_s),
        pupil=strength * PUPIL_SHARE * _wavering(rng, time_s, PUPIL_HZ),
        noise_seed=int(rng.integers(2**31)),
        noise_codes=strength * NOISE_CODES,
    )


def _wavering(rng: np.random.Generator, time_s: Array, band_hz: tuple[float, float]) -> Array:
    """A smooth random signal with SD 1: sines of random rates within the band, and random phases."""
    rates = rng.uniform(*band_hz, PARTS_OF_SWAY)
    phases = rng.uniform(0, 2 * np.pi, PARTS_OF_SWAY)
    waves = np.sin(2 * np.pi * rates * time_s[:, None] + phases)
    return np.asarray(np.sqrt(2 / PARTS_OF_SWAY) * waves.sum(axis=1))


def _gaze_deg(rng: np.random.Generator, time_s: Array) -> Array:
    """(n, 2) direction of gaze: rests, with drift, and saccades between them."""
    gaze = DRIFT_DEG * np.stack([_wavering(rng, time_s, (0.1, 2.0)) for _ in range(2)], axis=1)
    landing, begin = np.zeros(2), float(rng.uniform(*SHIFT_EVERY_S))
    while begin < time_s[-1]:
        # People look up and down less than to the sides.
        goal = rng.normal(0.0, SHIFT_DEG, 2) * (1.0, 0.5)
        way = goal - landing
        length_s = SACCADE_S + SACCADE_S_PER_DEG * float(np.hypot(*way))
        done = np.clip((time_s - begin) / length_s, 0.0, 1.0)
        gaze += (done * done * (3 - 2 * done))[:, None] * way
        landing, begin = goal, begin + float(rng.uniform(*SHIFT_EVERY_S))
    return gaze


@dataclass(frozen=True, eq=False)
class EyeRegions:
    """Where the eyes of a character lie in its frame.

    Attributes
    ----------
    gaze : float32 array (h, w)
        1 within the eye openings, falling to 0 around them: the share of the gaze's motion that a pixel has.
    pupils_px : float64 array (eyes, 2)
        Centers of the pupils (x, y).
    px_per_mm : float
    """

    gaze: NDArray[np.float32]
    pupils_px: Array
    px_per_mm: float

    @cached_property
    def grid(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The place of each pixel: x and y."""
        height, width = self.gaze.shape
        rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
        return columns, rows

    @cached_property
    def pupil_field(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The displacement in px (x, y) where the pupils grow by their whole radius."""
        x, y = self.grid
        field = np.zeros((2, *self.gaze.shape), np.float32)
        for center in self.pupils_px:
            across, down = x - np.float32(center[0]), y - np.float32(center[1])
            radius = PUPIL_MM * self.px_per_mm
            # Strongest at the rim of the pupil, nothing at the center and beyond the iris.
            share = np.exp(-((np.hypot(across, down) / radius - 1.0) ** 2) * 4.0)
            # At the center itself there is no direction.
            field += radius * share * np.stack((across, down)) / np.maximum(np.hypot(across, down), 1e-3)
        return field[0], field[1]

    @cached_property
    def from_middle(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The place of each pixel relative to the middle of the frame."""
        height, width = self.gaze.shape
        x, y = self.grid
        return x - np.float32(width / 2), y - np.float32(height / 2)

    @classmethod
    def of_pictures(
        cls, opened: NDArray[np.floating], closed: NDArray[np.floating], px_per_mm: float
    ) -> "EyeRegions":
        """Find the eyes: where a blink changes the picture, and there the darkest spots.

        Parameters
        ----------
        opened, closed : float array (h, w)
            Luma of the whole frame.
        px_per_mm : float
        """
        import cv2

        changed = np.abs(opened - closed).astype(np.float32)
        smooth = cv2.GaussianBlur(changed, (0, 0), 0.5 * px_per_mm)
        inside = (smooth > 0.25 * smooth.max()).astype(np.float32)
        gaze = cv2.GaussianBlur(inside, (0, 0), 0.8 * px_per_mm)
        dark = cv2.GaussianBlur(opened.astype(np.float32), (0, 0), 1.2 * px_per_mm)
        # Within the openings alone: hair and brows may be darker than a pupil.
        dark = np.where(inside > 0, dark, np.inf)
        middle = opened.shape[1] // 2
        pupils = []
        for start, half in ((0, dark[:, :middle]), (middle, dark[:, middle:])):
            if np.isfinite(half).any():
                row, column = np.unravel_index(int(np.argmin(half)), half.shape)
                pupils.append((start + column, row))
        return cls(gaze, np.array(pupils, np.float64).reshape(-1, 2), px_per_mm)

    def moved_from(self, life: Life, samples: NDArray[np.int64], weights: Array) -> "Displacement":
        """Mean displacement of the pixels over the samples of a frame."""
        return Displacement(
            head_px=self.px_per_mm * (weights @ life.head_mm[samples]),
            roll=float(np.deg2rad(weights @ life.roll_deg[samples])),
            gaze_px=self.px_per_mm * (weights @ life.gaze_mm[samples]),
            pupil=float(weights @ life.pupil[samples]),
        )

    def warped(
        self, picture: NDArray[np.float32], moved: "Displacement", sign: int = 1
    ) -> NDArray[np.float32]:
        """A picture with its content moved; sign -1 undoes it, up to second order."""
        import cv2

        x, y = self.grid
        along, down = self.from_middle
        pupil_x, pupil_y = self.pupil_field
        # Python's numbers leave arrays at 32 bits; NumPy's 64-bit ones would take half of the rendering time.
        head_x, head_y = (sign * float(part) for part in moved.head_px)
        gaze_x, gaze_y = (sign * float(part) for part in moved.gaze_px)
        roll, pupil = sign * moved.roll, sign * moved.pupil
        maps = (
            x - (head_x - roll * down + gaze_x * self.gaze + pupil * pupil_x),
            y - (head_y + roll * along + gaze_y * self.gaze + pupil * pupil_y),
        )
        # Reflected at the border: a frame cut from a larger picture goes on beyond it.
        return np.asarray(
            cv2.remap(picture, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101), np.float32
        )


@dataclass(frozen=True, eq=False)
class Displacement:
    """Where the content of one picture lies, relative to the character at rest."""

    head_px: Array
    roll: float
    gaze_px: Array
    pupil: float


def moments_of(
    life: Life, samples: NDArray[np.int64], weights: Array, px_per_mm: float
) -> Iterator[tuple[NDArray[np.int64], Array, float]]:
    """Parts of a frame's time to be warped and averaged: one, or several if much moves within it.

    Yields
    ------
    Samples of the part, their weights, which sum to 1, and the share of the part in the frame.
    """
    path = life.head_mm[samples] + life.gaze_mm[samples]
    moves_px = px_per_mm * float(np.ptp(path, axis=0).max())
    parts = WARPS_PER_FRAME if moves_px > SHARP_PX and len(samples) >= WARPS_PER_FRAME else 1
    for chosen in np.array_split(np.arange(len(samples)), parts):
        share = float(weights[chosen].sum())
        yield samples[chosen], weights[chosen] / share, share


def noise_of(life: Life, number: int, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Sensor noise of a frame's luma, in 8-bit steps."""
    # By the frame's number: the noise does not depend on which frames were painted before.
    rng = np.random.default_rng((life.noise_seed, number))
    return rng.standard_normal(shape, np.float32) * np.float32(life.noise_codes)


def following_lids(closure: Array, life: Life, opening_mm: float) -> Array:
    """Closure of lids that follow the gaze: the upper lid sinks with the eye, and leaves a blink as it is.

    Parameters
    ----------
    closure : float64 array (n,)
    life : Life
    opening_mm : float
        Height of the open eye.
    """
    # An eye that looks up would lift the lid beyond the open picture, which no level shows.
    down = np.maximum(life.gaze_mm[:, 1], 0.0) / opening_mm
    return np.asarray(np.round(np.clip(closure + (1.0 - closure) * down, 0.0, 1.0), DECIMALS))
