"""New blinks that close as recorded ones do: three phases modelled apart, drawn between neighbours.

The PCA model (paper 3.3.2) scales closing and opening to one length and draws coefficients evenly: closed
phases of different lengths cancel in the mean, so its blinks close less than the recorded ones and turn in
a cusp. Here a blink is its closing, closed and opening phase, each with length and form, and a peak closure.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.profile import PROFILE_FPS, Array, BlinkProfile, resample, with_minimum_at_peak

TOP = 0.97
"""Part of the peak closure above which a lid counts as closed: the closed phase."""
NODES = 25
NEIGHBOURS = 3
SPREAD = 0.12
"""Spread of the noise on drawn lengths and openings, as part of the recordings' own spread."""


@dataclass(frozen=True, eq=False)
class PhaseModel:
    """Recorded blinks taken apart.

    Parameters
    ----------
    numbers : (blinks, 4) array
        Logarithms of the closing, closed and opening length in samples at 300 fps, and the peak closure.
    forms : (blinks, 3, NODES) array
        Closure over each phase, 1 at the peak, over even shares of the phase.
    trained_on : tuple of str
    """

    numbers: Array
    forms: Array
    trained_on: tuple[str, ...]

    @classmethod
    def fit(cls, profiles: Sequence[BlinkProfile]) -> "PhaseModel":
        """Take recorded profiles of one eye apart; three or more are needed."""
        if len(profiles) < 3:
            raise InputError(f"the blink model needs 3 profiles or more, got {len(profiles)}")
        parts = [_apart(profile) for profile in profiles]
        return cls(
            np.array([numbers for numbers, _ in parts]),
            np.array([forms for _, forms in parts]),
            tuple(profile.profile_id for profile in profiles),
        )

    def sample(
        self, duration_frames_30fps: float | None, rng: np.random.Generator, *, profile_id: str
    ) -> BlinkProfile:
        """Draw a blink between a recorded one and one of its nearest neighbours.

        Lengths and peak are w a + (1 - w) b + noise, forms w A + (1 - w) B; w is even over 0.5 to 1, a and b
        two recorded blinks of which b is one of the three nearest to a. Given a duration (frames at 30 fps)
        the blink is scaled to it. The same generator state gives the same blink.
        """
        spread = np.maximum(self.numbers.std(axis=0), 1e-6)
        one = int(rng.integers(len(self.numbers)))
        away = (((self.numbers - self.numbers[one]) / spread) ** 2).sum(1)
        near = np.argsort(away, kind="stable")[1 : 1 + NEIGHBOURS]
        two = int(near[rng.integers(near.size)])
        weight = float(rng.uniform(0.5, 1.0))
        numbers = weight * self.numbers[one] + (1 - weight) * self.numbers[two]
        numbers = numbers + rng.normal(0, SPREAD, 4) * spread
        forms = weight * self.forms[one] + (1 - weight) * self.forms[two]
        blink = _together(numbers, forms, profile_id)
        return blink if duration_frames_30fps is None else resample(blink, duration_frames_30fps)


def _apart(profile: BlinkProfile) -> tuple[Array, Array]:
    """Lengths, peak and forms of one blink."""
    closure = profile.closure[profile.onset_index : profile.end_index + 1]
    peak = float(closure.max())
    share = closure / peak
    frames = np.arange(closure.size)
    top = np.flatnonzero(share >= TOP)
    # Where 97% is crossed between samples.
    first = np.interp(TOP, share[top[0] - 1 : top[0] + 1], frames[top[0] - 1 : top[0] + 1]) if top[0] else 0.0
    last = float(top[-1])
    if top[-1] + 1 < closure.size:
        last = float(np.interp(TOP, share[top[-1] : top[-1] + 2][::-1], frames[top[-1] : top[-1] + 2][::-1]))
    ends = [(0.0, float(first)), (float(first), last), (last, float(closure.size - 1))]
    grid = np.linspace(0, 1, NODES)
    forms = [np.interp(start + grid * (end - start), frames, share) for start, end in ends]
    lengths = [max(end - start, 0.5) for start, end in ends]
    return np.array([*np.log(lengths), peak]), np.array(forms)


def _together(numbers: Array, forms: Array, profile_id: str) -> BlinkProfile:
    """Lay the phases one after the other and read them at 300 fps."""
    lengths = np.maximum(np.exp(numbers[:3]), [3.0, 0.5, 4.0])
    peak = float(np.clip(numbers[3], 0.05, 1.0))
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    grid = np.linspace(0, 1, NODES)
    times = np.concatenate([starts[k] + grid * lengths[k] for k in range(3)])
    # The phases share their ends: the mean of both sides leaves no step.
    values = np.maximum(np.concatenate(list(forms)), 0.0)
    samples = np.interp(np.arange(int(np.ceil(starts[-1])) + 1), times, values)
    closure = np.round(np.clip(samples / samples.max() * peak, 0.0, 1.0), 9)
    closure[0] = closure[-1] = 0.0
    minimum = int(closure.argmax())
    return with_minimum_at_peak(
        BlinkProfile(
            profile_id=profile_id,
            closure=closure,
            minimum_index=minimum,
            down_frames=minimum,
            up_frames=closure.size - 1 - minimum,
            amplitude=peak,
            source="phase model",
            fps=PROFILE_FPS,
        )
    )
