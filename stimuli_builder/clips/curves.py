"""From a cell and an exemplar to the closure curve of its clip, sample by sample at 300 fps."""

import hashlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.declaration.rendering import RenderSettings
from experiments.errors import InputError
from stimuli_builder.blinks.export import lower_lid
from stimuli_builder.blinks.profile import PROFILE_FPS, BlinkProfile, to_full_closure, to_natural_closure

Array = NDArray[np.float64]


def samples_per_frame(fps: float) -> float:
    """Samples at 300 fps in one output frame: 10 at 30 fps, 12.5 at 24 fps."""
    return PROFILE_FPS / fps


# Random numbers that depend on names alone, the same on every machine.


def generator(*parts: str | int) -> np.random.Generator:
    """A generator seeded by the given names and numbers."""
    # A separator that no name holds, else "a1" + "2" and "a" + "12" would draw the same numbers.
    text = "\x1f".join(str(part) for part in parts)
    return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "little"))


Reach = tuple[tuple[float, float], tuple[float, float]]

LEAD_IN_S = (0.35, 0.80)
LEAD_OUT_S = (0.35, 0.60)
"""Shortest and longest open-eye time before and after a blink; drawn for every clip by its seed."""
# Far finer than any level of light, and coarse enough that every machine writes the same digits into the
# hash of a clip.
DECIMALS = 6
HELD_MM = 0.3
"""The tolerance of the picture itself (`stimuli verify`)."""


@dataclass(frozen=True, eq=False)
class ClipCurve:
    """What a clip shows over time, at 300 fps.

    Attributes
    ----------
    closure : float64 array (n,)
        0 open, 1 closed; of the left eye where `closure_other` holds the right one's.
    lower_vertical_mm, lower_horizontal_mm : float64 array (n,) or None
        The lower lid's lift and its slide toward the nose; None leaves the lower lid to the character.
    onset_sample : int
        Where the blink begins; the first of a performance.
    blinks_s : tuple of float
        Where the blinks of a performance begin, in s; empty for a single blink.
    """

    closure: Array
    onset_sample: int
    profile_id: str = ""
    duration_frames: float = 0.0
    closure_other: Array | None = None
    lower_vertical_mm: Array | None = None
    lower_horizontal_mm: Array | None = None
    blinks_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name in ("closure", "closure_other", "lower_vertical_mm", "lower_horizontal_mm"):
            values = getattr(self, name)
            if values is None:
                continue
            if len(values) != len(self.closure) or not np.isfinite(values).all():
                raise InputError(f"{self.profile_id}: {name} needs {len(self.closure)} finite samples")
            if name.startswith("closure") and (values.min() < 0 or values.max() > 1):
                raise InputError(
                    f"{self.profile_id}: closure must lie between 0 and 1, "
                    f"got {values.min():g} to {values.max():g}"
                )

    def motion(self, samples: NDArray[np.int64]) -> Array:
        """(signals, samples) of all that moves, for comparing and resting frames."""
        signals = (self.closure, self.closure_other, self.lower_vertical_mm, self.lower_horizontal_mm)
        return np.stack([signal[samples] for signal in signals if signal is not None])


@dataclass(frozen=True)
class Timing:
    """How a blink is laid into a clip: whole frames of open eye around it, and its sub-frame start.

    `phase_samples` samples pass after the last lead-in frame until the onset, so that blinks begin
    anywhere within a frame, as recorded ones do.
    """

    lead_in_frames: int
    lead_out_frames: int
    phase_samples: int
    fps: float

    @classmethod
    def drawn(cls, fps: float, phase_samples: int, *seed: str | int) -> "Timing":
        """Draw lead-in and lead-out lengths evenly from their ranges."""
        rng = generator("timing", *seed)
        lead_in, lead_out = (
            int(rng.integers(round(low * fps), round(high * fps) + 1))
            for low, high in (LEAD_IN_S, LEAD_OUT_S)
        )
        return cls(lead_in, lead_out, phase_samples, fps)


def amplitude_of(profile: BlinkProfile, amplitude: str) -> BlinkProfile:
    """The profile in the condition `full` (FC) or `natural` (NC)."""
    return to_full_closure(profile) if amplitude == "full" else to_natural_closure(profile)


def clip_curve(
    profile: BlinkProfile, timing: Timing, lower: str, clip_frames: int | None = None
) -> ClipCurve:
    """Lay a blink into a clip: its first level before it, its last level after it.

    Parameters
    ----------
    lower : {"both", "vertical", "horizontal", "none"}
        Which lower-lid signals move; `none` leaves the lower lid at rest.
    clip_frames : int, optional
        Fixed length of the clip; the lead-out gives way.

    Raises
    ------
    InputError
        The blink does not fit into `clip_frames`.
    """
    step = samples_per_frame(timing.fps)
    onset = round(timing.lead_in_frames * step) + timing.phase_samples
    end = onset + len(profile.closure)
    # A whole number of frames may come out a rounding error long.
    frames = clip_frames or int(np.ceil(end / step - 1e-9)) + timing.lead_out_frames
    total = int(np.ceil(frames * step - 1e-9))
    if end > total:
        raise InputError(
            f"profile {profile.profile_id} ends at frame {end / step:.1f}, {onset / step:.1f} including "
            f"frames of open eye, which is longer than the clip of {frames} frames; use a longer clip"
        )

    def held(values: Array) -> Array:
        # The eye rests as the recording left it: a jump to the mean opening would be an extra movement.
        return np.pad(values, (onset, total - end), mode="edge")

    def laid(values: Array) -> Array:
        return np.round(held(values), DECIMALS)

    curve = ClipCurve(
        closure=laid(profile.closure),
        closure_other=None if profile.closure_other is None else laid(profile.closure_other),
        onset_sample=onset + profile.onset_index,
        profile_id=profile.profile_id,
        duration_frames=round(profile.duration_frames_30fps, 3),
    )
    if lower == "none":
        return curve
    if profile.lower_up_mm is not None and profile.lower_nasal_mm is not None:
        vertical, horizontal = laid(profile.lower_up_mm), laid(profile.lower_nasal_mm)
    else:
        signals = lower_lid(profile, held(profile.closure))
        vertical, horizontal = (np.round(signal, DECIMALS) for signal in signals)
    still = np.zeros(total)
    return replace(
        curve,
        lower_vertical_mm=vertical if lower in ("both", "vertical") else still,
        lower_horizontal_mm=horizontal if lower in ("both", "horizontal") else still,
    )


ANTICIPATION_S, SETTLE_S = 0.13, 0.3
"""An animator draws four frames of anticipation at 30 fps, and nine in which a lid settles."""
OVERSHOOT = 0.08
"""How far beyond their rest the lids lift at strength 1, as a share of the opening."""


def with_overshoot(curve: ClipCurve, anticipation: float, settle: float) -> ClipCurve:
    """The curve of a single blink whose lids lift before it, and settle after it; itself at 0.

    No picture shows an eye wider than open, so the lids rest lower by what they lift. The blink itself goes
    on as before: it closes what is open at each moment.

    Parameters
    ----------
    anticipation, settle : float
        Strengths from 0 to 1.
    """
    if not anticipation and not settle:
        return curve
    rest = OVERSHOOT * max(anticipation, settle)
    before, after = rest - OVERSHOOT * anticipation, rest - OVERSHOOT * settle
    shut = int(curve.closure.argmax())
    # After the peak, whatever a profile's stated length: times must rise.
    end = max(shut + 1, curve.onset_sample + round(curve.duration_frames * PROFILE_FPS / 30))
    lift = curve.onset_sample - ANTICIPATION_S * PROFILE_FPS
    # While the eye is shut, its resting place passes unseen from the one to the other.
    times = np.array([lift, curve.onset_sample, shut, end, end + SETTLE_S * PROFILE_FPS])
    places = np.array([rest, before, before, after, rest])
    sample = np.arange(len(curve.closure), dtype=np.float64)
    part = np.clip(np.searchsorted(times, sample, side="right") - 1, 0, len(times) - 2)
    done = np.clip((sample - times[part]) / (times[part + 1] - times[part]), 0.0, 1.0)
    # Smooth at both ends of each part: the minimum-jerk course.
    eased = done**3 * (10.0 + done * (6.0 * done - 15.0))
    resting = places[part] + (places[part + 1] - places[part]) * eased

    def over(closure: Array) -> Array:
        return np.asarray(np.round(resting + (1.0 - resting) * closure, DECIMALS))

    other = curve.closure_other
    return replace(curve, closure=over(curve.closure), closure_other=None if other is None else over(other))


def with_lower_lid_gain(curve: ClipCurve, gain: float) -> ClipCurve:
    """The curve with the lower lid's lift and slide times `gain`; itself at 1."""
    if gain == 1.0 or curve.lower_vertical_mm is None or curve.lower_horizontal_mm is None:
        return curve
    return replace(
        curve,
        lower_vertical_mm=np.round(gain * curve.lower_vertical_mm, DECIMALS),
        lower_horizontal_mm=np.round(gain * curve.lower_horizontal_mm, DECIMALS),
    )


def shown_by(
    curve: ClipCurve, settings: RenderSettings, reach: Reach | None
) -> tuple[ClipCurve, dict[str, str]]:
    """The curve as a character shows it: with overshoot and the lower lid's gain, checked for reach.

    Returns and raises as `within_reach` does.
    """
    if settings.performance is None:
        curve = with_overshoot(curve, settings.anticipation, settings.settle)
    return within_reach(with_lower_lid_gain(curve, settings.lower_lid_gain), reach)


def within_reach(curve: ClipCurve, reach: Reach | None) -> tuple[ClipCurve, dict[str, str]]:
    """Check that a character was baked for the lower lid's motion; signals are not scaled to fit.

    Where a signal passes a limit by at most HELD_MM (a tracked lid wavers about its resting place), it is
    held there.

    Parameters
    ----------
    reach : ((low, high), (low, high)) in mm, or None
        What the character can show of lift and of slide toward the nose.

    Returns
    -------
    The curve, and for the manifest by how much signals were held back, in mm.

    Raises
    ------
    InputError
        A signal goes further than that beyond what was baked.
    """
    if reach is None or curve.lower_vertical_mm is None or curve.lower_horizontal_mm is None:
        return curve, {}
    vertical = _held(curve, curve.lower_vertical_mm, reach[0], "up")
    horizontal = _held(curve, curve.lower_horizontal_mm, reach[1], "toward the nose")
    said = {"lower_vertical_held_mm": vertical[1], "lower_horizontal_held_mm": horizontal[1]}
    shown = replace(curve, lower_vertical_mm=vertical[0], lower_horizontal_mm=horizontal[0])
    return shown, {name: f"{beyond:.4f}" for name, beyond in said.items() if beyond > 10.0**-DECIMALS}


def _held(curve: ClipCurve, signal: Array, limits: tuple[float, float], way: str) -> tuple[Array, float]:
    """The signal within the limits, and how far it went beyond them."""
    held = np.clip(signal, *limits)
    beyond = float(np.abs(signal - held).max())
    if beyond > HELD_MM:
        raise InputError(
            f"profile {curve.profile_id} moves the lower lid {signal.min():.2f} to {signal.max():.2f} mm "
            f"{way}, but its character is baked for {limits[0]:g} to {limits[1]:g} mm. Bake a larger range "
            "(docs/explanation/characters.md) or omit this signal with lower_lid"
        )
    return held, beyond
