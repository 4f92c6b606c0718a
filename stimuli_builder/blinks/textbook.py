"""The four textbook blinks: linear and ease-in/ease-out, symmetric and asymmetric (paper 3.3.3, 3.3.4)."""

from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from experiments.errors import InputError, did_you_mean
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import SAMPLES_PER_CLIP_FRAME, Array, BlinkProfile, split_duration

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
        S: both phases of one length; A: phases in the recorded ratio. Ease: a cubic Bezier a phase.
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
    for _ in range(60):
        x = 3 * u * (1 - u) ** 2 * handle + 3 * u**2 * (1 - u) * (1 - handle) + u**3
        low, high = np.where(x < time, u, low), np.where(x < time, high, u)
        u = (low + high) / 2
    u[0], u[-1] = 0.0, 1.0
    rise: Array = u * u * (3 - 2 * u)
    return rise
