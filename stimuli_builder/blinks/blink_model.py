"""New blinks: the PCA blink model (paper 3.3.2), three phases modeled apart, and the textbook blinks."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from experiments.errors import InputError, did_you_mean
from experiments.files import whole_text
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import (
    PROFILE_FPS,
    SAMPLES_PER_CLIP_FRAME,
    Array,
    BlinkProfile,
    phase_spline,
    resample,
    resample_phases,
    split_duration,
    with_minimum_at_peak,
)

# The PCA blink model: learns from recorded profiles, makes new ones (paper 3.3.2, Figure 7).

SHIPPED_MODEL = Path(__file__).parent / "library" / "model.json"
MODEL_FORMAT = "palpebra-blink-model-1"
MAX_DRAWS = 1000


@dataclass(frozen=True, eq=False)
class BlinkModel:
    """Principal components of length-normalized blinks, with their two scaling factors.

    A row of the data matrix is [closure of the closing phase, of the opening phase (of the second eye
    likewise, where there is one), weight x down-phase scale, weight x up-phase scale].

    Parameters
    ----------
    mean : (d,) array
    components : (k, d) array
        Orthonormal rows, greatest variance first.
    coefficient_sd : (k,) array
        Standard deviation of the training blinks' coefficients.
    explained : (k,) array
        Share of the variance each kept component carries.
    down_frames, up_frames : int
        Mean phase lengths at 300 fps, to which blinks are normalized.
    scale_weight : float
        Weight of the scaling-factor columns, see `fit`.
    eyes : int
        1, or 2 where left/right asymmetry is modeled.
    trained_on : tuple of str
        Names of the training profiles.
    """

    mean: Array
    components: Array
    coefficient_sd: Array
    explained: Array
    down_frames: int
    up_frames: int
    scale_weight: float
    eyes: int
    trained_on: tuple[str, ...]

    @classmethod
    def fit(cls, profiles: Sequence[BlinkProfile], components: int = 5) -> "BlinkModel":
        """Fit the model to recorded profiles; two-eyed when every profile has both eyes.

        The scaling-factor columns get the weight that gives them together the same variance as all
        closure samples together: the energy normalization the paper uses to couple shape and
        appearance (equation 5), so that neither timing nor form rules the components.
        """
        if len(profiles) < 3:
            raise InputError(f"the blink model needs 3 profiles or more, got {len(profiles)}")
        if not 1 <= components < len(profiles):
            raise InputError(
                f"{len(profiles)} profiles allow 1 to {len(profiles) - 1} components, got {components}"
            )
        eyes = 2 if all(profile.closure_other is not None for profile in profiles) else 1
        # Means of the phases, so that the scaling factors vary about 1.
        down = round(float(np.mean([profile.down_frames for profile in profiles])))
        up = round(float(np.mean([profile.up_frames for profile in profiles])))
        form = np.array([_normalised(profile, down, up, eyes) for profile in profiles])
        scales = np.array([[p.down_frames / down, p.up_frames / up] for p in profiles])
        weight = _energy_weight(form, scales)
        data = np.hstack([form, weight * scales])
        mean = data.mean(axis=0)
        _, singular, rows = np.linalg.svd(data - mean, full_matrices=False)
        variance = singular**2 / (len(profiles) - 1)
        return cls(
            mean=mean,
            components=_signed(rows[:components]),
            coefficient_sd=np.sqrt(variance[:components]),
            # Profiles that are all alike have no variance to share.
            explained=variance[:components] / max(variance.sum(), 1e-30),
            down_frames=down,
            up_frames=up,
            scale_weight=weight,
            eyes=eyes,
            trained_on=tuple(profile.profile_id for profile in profiles),
        )

    @property
    def variance_kept(self) -> float:
        """Share of the variance all kept components carry together."""
        return float(self.explained.sum())

    def coefficients(self, profile: BlinkProfile) -> Array:
        """Return the (k,) coefficients of a profile in the space of the model."""
        form = _normalised(profile, self.down_frames, self.up_frames, self.eyes)
        scales = np.array([profile.down_frames / self.down_frames, profile.up_frames / self.up_frames])
        return self.components @ (np.concatenate([form, self.scale_weight * scales]) - self.mean)

    def normalised_forms(self, coefficients: Array) -> tuple[Array, float, float]:
        """Closure (eyes, down + up + 1) at mean length and the two scaling factors, for (k,) coefficients."""
        row = self.mean + coefficients @ self.components
        form = row[:-2].reshape(self.eyes, self.down_frames + self.up_frames + 1)
        return form, float(row[-2] / self.scale_weight), float(row[-1] / self.scale_weight)

    def profile(self, coefficients: Array, profile_id: str) -> BlinkProfile | None:
        """Return the blink of these coefficients, or None where its inter-eyelid distance is negative.

        A closure above 1 is a negative distance: the paper drops such blinks. A closure below 0, an eye
        opened wider than its reference, is cut to 0.
        """
        form, down_scale, up_scale = self.normalised_forms(coefficients)
        down, up = round(self.down_frames * down_scale), round(self.up_frames * up_scale)
        # Dropped, not cut: cut blinks would all close by exactly 1, which no recorded set does.
        if form.max() > 1.0 or down < 1 or up < 1:
            return None
        closure = np.round(np.maximum(form, 0.0), 9)
        normal = BlinkProfile(
            profile_id=profile_id,
            closure=closure[0],
            minimum_index=self.down_frames,
            down_frames=self.down_frames,
            up_frames=self.up_frames,
            amplitude=float(np.ptp(closure[0])),
            source="PCA blink model",
            eye="both" if self.eyes == 2 else None,
            closure_other=closure[1] if self.eyes == 2 else None,
        )
        return with_minimum_at_peak(resample_phases(normal, down, up))

    def sample(
        self,
        duration_frames_30fps: float | None = None,
        rng: np.random.Generator | None = None,
        *,
        profile_id: str | None = None,
    ) -> BlinkProfile:
        """Draw a new blink: coefficients even within one standard deviation, negative blinks drawn again.

        Given a duration (frames at 30 fps) the blink is scaled to it, the drawn ratio of phases kept;
        without one its length is the drawn one. The same generator state gives the same blink.
        """
        generator = np.random.default_rng() if rng is None else rng
        for _ in range(MAX_DRAWS):
            # Even within one SD, after the paper: normal draws would often leave what was recorded.
            relative = generator.uniform(-1.0, 1.0, self.coefficient_sd.size)
            name = profile_id or "model-" + "-".join(f"{value * 1000:+.0f}" for value in relative)
            blink = self.profile(relative * self.coefficient_sd, name)
            if blink is not None:
                return blink if duration_frames_30fps is None else resample(blink, duration_frames_30fps)
        raise InputError(
            f"the model gave {MAX_DRAWS} blinks with a negative distance in a row: fit it to other profiles"
        )

    def save(self, path: Path) -> None:
        """Write the model as JSON."""
        content = {
            "format": MODEL_FORMAT,
            "fps": PROFILE_FPS,
            "eyes": self.eyes,
            "down_frames": self.down_frames,
            "up_frames": self.up_frames,
            "scale_weight": self.scale_weight,
            "explained": self.explained.tolist(),
            "coefficient_sd": self.coefficient_sd.tolist(),
            "trained_on": list(self.trained_on),
            "mean": np.round(self.mean, 9).tolist(),
            "components": np.round(self.components, 9).tolist(),
        }
        with whole_text(path) as stream:
            stream.write(json.dumps(content, indent=1) + "\n")

    @classmethod
    def load(cls, path: Path) -> "BlinkModel":
        """Read a model written by `save`."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != MODEL_FORMAT:
                raise InputError(
                    f"{path.name}: expected the format {MODEL_FORMAT}, got {content['format']!r}"
                )
            numbers = {
                key: np.array(content[key]) for key in ("mean", "components", "coefficient_sd", "explained")
            }
            return cls(
                **numbers,
                down_frames=int(content["down_frames"]),
                up_frames=int(content["up_frames"]),
                scale_weight=float(content["scale_weight"]),
                eyes=int(content["eyes"]),
                trained_on=tuple(content["trained_on"]),
            )
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); create a model with `stimuli model fit`"
            ) from error
        except InputError:
            raise
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"{path}: not a blink model ({error}); create one with `stimuli model fit`"
            ) from error


@lru_cache(maxsize=1)
def default_model() -> BlinkModel:
    """Return the shipped model, fitted to the shipped profiles."""
    return BlinkModel.load(SHIPPED_MODEL)


def _normalised(profile: BlinkProfile, down_frames: int, up_frames: int, eyes: int) -> Array:
    eye_closures = [profile.closure] if eyes == 1 else [profile.closure, profile.closure_other]
    middle, parts = profile.minimum_index, []
    for closure in eye_closures:
        if closure is None:
            raise InputError(f"profile {profile.profile_id} has one eye; this model needs both")
        parts.append(phase_spline(closure[profile.onset_index : middle + 1], down_frames))
        # Both phases have the minimum: it is taken once.
        parts.append(phase_spline(closure[middle : profile.end_index + 1], up_frames)[1:])
    return np.concatenate(parts)


def _energy_weight(form: Array, scales: Array) -> float:
    timing = float(scales.var(axis=0).sum())
    # With a weight of 0 the scales could not be read back from a row.
    return 1.0 if timing < 1e-12 else float(np.sqrt(form.var(axis=0).sum() / timing)) or 1.0


def _signed(rows: Array) -> Array:
    """Fix each component's sign (its largest entry positive): an SVD leaves it to the machine."""
    largest = rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)]
    return rows * np.where(largest < 0, -1.0, 1.0)[:, None]


# New blinks that close as recorded ones do: three phases modeled apart, drawn between neighbors.
#
# The PCA model (paper 3.3.2) scales closing and opening to one length and draws coefficients evenly: closed
# phases of different lengths cancel in the mean, so its blinks close less than the recorded ones and turn
# in a cusp. Here a blink is its closing, closed and opening phase, each with length and form, and a peak
# closure.

TOP = 0.97
"""Part of the peak closure above which a lid counts as closed: the closed phase."""
NODES = 25
NEIGHBOURS = 3
SPREAD = 0.12
"""Spread of the noise on drawn lengths and openings, as part of the recordings' own spread."""


# Decision 0372: Blinks are sampled phase by phase.
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
        """Draw a blink between a recorded one and one of its nearest neighbors.

        Lengths and peak are w a + (1 - w) b + noise, forms w A + (1 - w) B; w is even over 0.5 to 1, a and b
        two recorded blinks of which b is one of the three nearest to a. Given a duration (frames at 30 fps)
        the blink is scaled to it. The same generator state gives the same blink.
        """
        spread = np.maximum(self.numbers.std(axis=0), 1e-6)
        one = int(rng.integers(len(self.numbers)))
        away = (((self.numbers - self.numbers[one]) / spread) ** 2).sum(1)
        # A stable sort: ties, as of blinks that are copies, come in one order on every machine. The first
        # is the blink itself.
        near = np.argsort(away, kind="stable")[1 : 1 + NEIGHBOURS]
        two = int(near[rng.integers(near.size)])
        # Nearer to the one than to the other, else most blinks would be averages, whose closed phase is too
        # smooth.
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
    # Turned round, since `np.interp` needs rising numbers and the share falls here.
    if top[-1] + 1 < closure.size:
        last = float(np.interp(TOP, share[top[-1] : top[-1] + 2][::-1], frames[top[-1] : top[-1] + 2][::-1]))
    ends = [(0.0, float(first)), (float(first), last), (last, float(closure.size - 1))]
    grid = np.linspace(0, 1, NODES)
    forms = [np.interp(start + grid * (end - start), frames, share) for start, end in ends]
    # Not 0, since lengths are kept as logarithms.
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
    # Open at both ends, or the lid would jump where the blink meets the open eye.
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


# The four textbook blinks: linear and ease-in/ease-out, symmetric and asymmetric (paper 3.3.3, 3.3.4).

TextbookKind = Literal["SL", "AL", "SL_ease", "AL_ease"]
TEXTBOOK_KINDS: tuple[TextbookKind, ...] = get_args(TextbookKind)

_TITLES = {
    "SL": "symmetric linear",
    "AL": "asymmetric linear",
    "SL_ease": "symmetric ease-in/ease-out",
    "AL_ease": "asymmetric ease-in/ease-out",
}


@lru_cache(maxsize=1)
def recorded_down_fraction() -> float:
    """Median share of the closing phase among the shipped recordings."""
    return float(np.median([profile.down_fraction for profile in load_library()]))


def textbook_profile(
    kind: TextbookKind,
    duration_frames: float,
    *,
    start_level: float = 0.0,
    end_level: float = 0.0,
    peak_closure: float = 1.0,
    subframe_phase: float = 0.0,
    down_fraction: float | None = None,
    handle: float = 1 / 3,
) -> BlinkProfile:
    """Return a textbook blink.

    Parameters
    ----------
    kind : {"SL", "AL", "SL_ease", "AL_ease"}
        S: both phases of one length; A: phases in the recorded ratio. Ease: a cubic Bezier per phase.
    duration_frames : float
        Onset to end, in frames at 30 fps.
    start_level, end_level : float
        Closure before onset and after the end.
    peak_closure : float
        Closure at the minimum, 1 for a blink that closes.
    subframe_phase : float in [0, 1)
        By which part of a 30 fps frame the onset comes after a frame's beginning; the start level is
        held for as many samples (whole 300 fps samples) before the onset.
    down_fraction : float, optional
        Share of the closing phase in an asymmetric blink; the recordings' median without it.
    handle : float in [0, 1]
        Bezier control points lie at this share of the phase's length from either end, level with it:
        in proportion to the lengths of the phases, as the paper has them. 1/3 is what animation
        programs set by themselves.
    """
    if kind not in TEXTBOOK_KINDS:
        raise InputError(f"unknown textbook blink '{kind}'{did_you_mean(kind, TEXTBOOK_KINDS)}")
    _check_levels(start_level, end_level, peak_closure, subframe_phase, handle)
    symmetric = kind.startswith("SL")
    fraction = 0.5 if symmetric else (recorded_down_fraction() if down_fraction is None else down_fraction)
    down, up = split_duration(duration_frames, fraction)
    ease = handle if kind.endswith("ease") else None
    lead = int(subframe_phase * SAMPLES_PER_CLIP_FRAME)
    closure = np.concatenate(
        [
            np.full(lead, start_level),
            start_level + (peak_closure - start_level) * _rise(down, ease),
            (end_level + (peak_closure - end_level) * _rise(up, ease)[::-1])[1:],
        ]
    )
    return BlinkProfile(
        profile_id=_name(kind, duration_frames, start_level, end_level, peak_closure, lead, down),
        closure=closure,
        minimum_index=lead + down,
        down_frames=down,
        up_frames=up,
        amplitude=peak_closure - min(start_level, end_level),
        source=f"textbook: {_TITLES[kind]}",
    )


def _name(kind: str, duration: float, start: float, end: float, peak: float, lead: int, down: int) -> str:
    levels = f"s{start * 1000:.0f}-e{end * 1000:.0f}-p{peak * 1000:.0f}"
    return f"textbook-{kind}-{duration:g}f-d{down}-{levels}-lead{lead}"


def _check_levels(start: float, end: float, peak: float, phase: float, handle: float) -> None:
    if not (0 <= start < peak <= 1 and 0 <= end < peak):
        raise InputError(
            f"levels need 0 <= start, end < peak <= 1, got start {start:g}, end {end:g}, peak {peak:g}"
        )
    if not 0 <= phase < 1:
        raise InputError(f"sub-frame phase must be at least 0 and below 1, got {phase:g}")
    if not 0 <= handle <= 1:
        raise InputError(f"Bezier handle must be between 0 and 1, got {handle:g}")


def _rise(length_frames: int, handle: float | None) -> Array:
    """From 0 to 1 in `length_frames` steps, linear or along a cubic Bezier with level handles."""
    time = np.linspace(0.0, 1.0, length_frames + 1)
    if handle is None:
        return time
    # Bezier points (0, 0), (handle, 0), (1 - handle, 1), (1, 1): solve x(u) = time, then y(u).
    u = time.copy()
    low, high = np.zeros_like(time), np.ones_like(time)
    # Sixty halvings are beyond the precision of a float64, whatever the handle.
    for _ in range(60):
        x = 3 * u * (1 - u) ** 2 * handle + 3 * u**2 * (1 - u) * (1 - handle) + u**3
        low, high = np.where(x < time, u, low), np.where(x < time, high, u)
        u = (low + high) / 2
    u[0], u[-1] = 0.0, 1.0
    rise: Array = u * u * (3 - 2 * u)
    return rise
