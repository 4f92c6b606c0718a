"""What a blink profile is: closure over time at 300 fps, and what may be done to it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_file
from stimuli_builder.blinks.csv_table import few, read_table, write_table

PROFILE_FPS = 300
SAMPLES_PER_CLIP_FRAME = 10
"""Samples at 300 fps in one frame of a 30 fps clip."""
OPEN_PERCENTILE = 85
"""Percentile of a series' lid distances taken as the open eye's, despite blinks and a few wide values."""

Array = NDArray[np.float64]
Eye = Literal["left", "right", "both"]


@dataclass(frozen=True, eq=False)
class BlinkProfile:
    """One blink: closure (0 open, 1 closed) sampled at `fps`.

    `closure[onset_index]` is the onset and `closure[end_index]` the end; a few samples of the start
    level may come before it (sub-frame phase). Recorded profiles begin and end at 0 (open), textbook
    ones at their start and end level: a renderer holds `closure[0]` in the lead-in, and in the lead-out
    `closure[-1]`; then nothing jumps.

    Parameters
    ----------
    profile_id : str
        Unique name, stable over versions.
    closure : (n,) float64 array
        Closure in [0, 1]; the left eye's where `closure_other` is given.
    minimum_index : int
        Sample of the least inter-eyelid distance, that is of the greatest closure.
    down_frames, up_frames : int
        Lengths of the closing and the opening phase in samples.
    amplitude : float
        Range of the closure, 1 for an eye that closes fully from fully open.
    source : str
        Where it comes from, in words: a recording, the model, a textbook curve.
    eye : {"left", "right", "both"} or None
        Eye measured; "both" where `closure_other` holds the right one, None for made curves.
    recording : str
        Name of the recording, empty for made curves.
    closure_other : (n,) float64 array or None
        The second (right) eye on the same samples, where both were measured.
    lower_up_mm, lower_nasal_mm : (n,) float64 array or None
        Measured motion of the lower lid in mm, where a track gave it; see `lower_lid.lower_lid`.
    rest_before, rest_after : float
        Closure of the resting eye before and after the recorded blink, against the wider of the two.
    """

    profile_id: str
    closure: Array
    minimum_index: int
    down_frames: int
    up_frames: int
    amplitude: float
    source: str
    eye: Eye | None = None
    recording: str = ""
    closure_other: Array | None = None
    lower_up_mm: Array | None = None
    lower_nasal_mm: Array | None = None
    rest_before: float = 0.0
    rest_after: float = 0.0
    fps: int = field(default=PROFILE_FPS)

    def __post_init__(self) -> None:
        for name in ("closure", "closure_other"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, _checked_closure(self.profile_id, values))
        for name in ("closure_other", "lower_up_mm", "lower_nasal_mm"):
            values = getattr(self, name)
            if values is not None and values.shape != self.closure.shape:
                raise InputError(
                    f"profile {self.profile_id}: {name} needs as many samples as closure, "
                    f"{self.closure.size}; got {values.size}"
                )
        # Strictly: both phases need a sample, and the end must be inside.
        if not 0 <= self.onset_index < self.minimum_index < self.end_index < self.closure.size:
            raise InputError(
                f"profile {self.profile_id}: onset {self.onset_index}, minimum {self.minimum_index} and end "
                f"{self.end_index} must lie in this order within {self.closure.size} samples"
            )

    @property
    def onset_index(self) -> int:
        """Sample at which the eye begins to close."""
        return self.minimum_index - self.down_frames

    @property
    def end_index(self) -> int:
        """Sample at which the eye is open again."""
        return self.minimum_index + self.up_frames

    @property
    def duration_frames_30fps(self) -> float:
        """Length from onset to end in frames of a 30 fps clip."""
        # Frames of 30 fps are the unit of the paper.
        return (self.down_frames + self.up_frames) * 30 / self.fps

    @property
    def duration_ms(self) -> float:
        """Length from onset to end in milliseconds."""
        return (self.down_frames + self.up_frames) * 1000 / self.fps

    @property
    def down_fraction(self) -> float:
        """Share of the blink spent closing, 0.5 for a symmetric blink."""
        return self.down_frames / (self.down_frames + self.up_frames)


def _checked_closure(profile_id: str, values: Array) -> Array:
    closure = np.array(values, dtype=np.float64)
    if closure.ndim != 1 or closure.size < 3:
        raise InputError(f"profile {profile_id}: closure needs 3 or more samples, got shape {closure.shape}")
    if not np.isfinite(closure).all() or closure.min() < -1e-9 or closure.max() > 1 + 1e-9:
        low, high = closure.min(), closure.max()
        raise InputError(f"profile {profile_id}: closure must be between 0 and 1, got {low:g} to {high:g}")
    # What is left beyond 0 and 1 is rounding.
    closure = np.clip(closure, 0.0, 1.0)
    # A frozen class does not keep its arrays from being changed in place.
    closure.setflags(write=False)
    return closure


def to_full_closure(profile: BlinkProfile) -> BlinkProfile:
    """Return the profile stretched so that it reaches closure 1 exactly (condition FC).

    The paper (4.1.1) says of FC that the distance is divided by its maximum and of NC by its range.
    Dividing by the maximum keeps whatever opening is left at the minimum; only subtracting the minimum
    and dividing by the range shuts the eye. The names decide: FC is the one that closes. With
    d' = (d - min d) / (max d - min d), closure' = 1 - d' is the closure less its least value, over its range.
    """
    stretched = _stretch(profile.closure)
    other = None if profile.closure_other is None else _stretch(profile.closure_other)
    return replace(profile, closure=stretched, closure_other=other, amplitude=1.0)


def to_natural_closure(profile: BlinkProfile) -> BlinkProfile:
    """Return the profile as measured (condition NC): a blink that stayed partly open stays so.

    See `to_full_closure` for why this is not the range normalization the paper's text names.
    """
    return profile


def _stretch(closure: Array) -> Array:
    low, high = float(closure.min()), float(closure.max())
    # A flat curve would be divided by rounding errors.
    if high - low < 1e-6:
        raise InputError("a profile without closing cannot be stretched to full closure")
    return (closure - low) / (high - low)


def phase_spline(samples: Array, length_frames: int) -> Array:
    """Resample one phase to `length_frames` intervals, ends kept.

    A monotone cubic spline (PCHIP) passes through every sample and never overshoots, so a closing
    phase stays one.
    """
    # Here, for it takes a third of a second: workers that render need only the types of this file.
    from scipy.interpolate import PchipInterpolator

    # Over 0 to 1: only the shape of the phase counts, not its length.
    spline = PchipInterpolator(np.linspace(0.0, 1.0, samples.size), samples)
    return np.asarray(spline(np.linspace(0.0, 1.0, length_frames + 1)), dtype=np.float64)


def resample_phases(profile: BlinkProfile, down_frames: int, up_frames: int) -> BlinkProfile:
    """Return the profile from onset to end with phases of the given lengths (samples at its own rate)."""
    if down_frames < 1 or up_frames < 1:
        raise InputError(f"a phase needs one frame or more, got {down_frames} down and {up_frames} up")

    # Each phase separately, so that the minimum stays where it belongs.
    def rescale(closure: Array) -> Array:
        middle = profile.minimum_index
        down = phase_spline(closure[profile.onset_index : middle + 1], down_frames)
        up = phase_spline(closure[middle : profile.end_index + 1], up_frames)
        # Both phases hold the minimum; it counts once.
        return np.concatenate([down, up[1:]])

    def rescale_if(values: Array | None) -> Array | None:
        return None if values is None else rescale(values)

    return replace(
        profile,
        closure=rescale(profile.closure),
        closure_other=rescale_if(profile.closure_other),
        lower_up_mm=rescale_if(profile.lower_up_mm),
        lower_nasal_mm=rescale_if(profile.lower_nasal_mm),
        minimum_index=down_frames,
        down_frames=down_frames,
        up_frames=up_frames,
    )


def with_minimum_at_peak(profile: BlinkProfile) -> BlinkProfile:
    """Move the minimum to the sample of greatest closure; in a generated blink it may be next to its
    place."""
    # Only between onset and end: samples before the onset are of the open eye.
    peak = profile.onset_index + int(profile.closure[profile.onset_index : profile.end_index + 1].argmax())
    if not profile.onset_index < peak < profile.end_index:
        raise InputError(
            f"profile {profile.profile_id} closes most at its onset or end, so it is not a blink"
        )
    down, up = peak - profile.onset_index, profile.end_index - peak
    return replace(profile, minimum_index=peak, down_frames=down, up_frames=up)


def split_duration(duration_frames_30fps: float, down_fraction: float) -> tuple[int, int]:
    """Share a duration, in frames at 30 fps, between the phases: whole 300 fps samples, one or more each."""
    finite = math.isfinite(duration_frames_30fps)
    total = round(duration_frames_30fps * SAMPLES_PER_CLIP_FRAME) if finite else 0
    if not 2 <= total <= 3000:
        raise InputError(f"a blink lasts between 0.2 and 300 frames at 30 fps, got {duration_frames_30fps:g}")
    # Rounding may leave a phase without a sample.
    down = min(max(round(total * down_fraction), 1), total - 1)
    return down, total - down


def resample(profile: BlinkProfile, duration_frames_30fps: float) -> BlinkProfile:
    """Return the profile scaled to a duration in frames at 30 fps, the ratio of its phases kept."""
    return resample_phases(profile, *split_duration(duration_frames_30fps, profile.down_fraction))


# Profiles on disk: one row per sample at 300 fps, its place counted from the blink's minimum.

EYES: dict[str, Eye | None] = {"left": "left", "right": "right", "both": "both", "": None}
TABLE_COLUMNS = {
    "profile_id": "name of the profile",
    "eye": "left, right, both (closure is the left eye's, closure_other the right one's) or empty",
    "from_minimum_frames": "place in frames at 300 fps from the minimum; the first sample is the onset",
    "closure": "0 open, 1 closed",
    "closure_other": "the same for the right eye where both were measured, else empty",
    "lower_up_mm": "lower lid's lift in mm where it was measured, else empty",
    "lower_nasal_mm": "lower lid's slide toward the nose in mm where it was measured, else empty",
}


def write_profile_table(path: Path, profiles: Sequence[BlinkProfile]) -> None:
    """Write profiles as a CSV of `TABLE_COLUMNS`; onset and end are the first and last sample."""
    # A table without blinks still has its header.
    samples = [_samples(profile) for profile in profiles] or [pd.DataFrame(columns=list(TABLE_COLUMNS))]
    with whole_file(path) as partial:
        write_table(partial, pd.concat(samples))


def _samples(profile: BlinkProfile) -> pd.DataFrame:
    part = slice(profile.onset_index, profile.end_index + 1)

    def column(values: Array | None) -> Array:
        absent = np.full(profile.closure.size, np.nan)
        # Six decimals are finer than any measurement, and equal on every computer.
        return (absent if values is None else np.round(values, 6))[part]

    return pd.DataFrame(
        {
            "profile_id": profile.profile_id,
            "eye": profile.eye or "",
            "from_minimum_frames": np.arange(-profile.down_frames, profile.up_frames + 1),
            "closure": column(profile.closure),
            "closure_other": column(profile.closure_other),
            "lower_up_mm": column(profile.lower_up_mm),
            "lower_nasal_mm": column(profile.lower_nasal_mm),
        }
    )


def read_profile_table(path: Path) -> list[BlinkProfile]:
    """Read a CSV written by `write_profile_table`."""
    table = read_table(path)
    for name in TABLE_COLUMNS:
        if name not in table.columns:
            there = few(list(table.columns))
            raise InputError(
                f"{path.name} is not a table of profiles (NAME.profiles.csv of `stimuli blinks`): the column "
                f"'{name}' is missing; it has {there}"
            )
    # Unsorted: in the order of the file, which is that of time.
    groups = table.groupby("profile_id", sort=False)
    return [_profile(str(name), group, path) for name, group in groups]


def _profile(profile_id: str, rows: pd.DataFrame, path: Path) -> BlinkProfile:
    offset = rows["from_minimum_frames"].to_numpy()
    # Whole numbers only: a table edited in a spreadsheet may have gaps or fractions.
    if offset.dtype.kind != "i" or (np.diff(offset) != 1).any() or not offset[0] < 0 < offset[-1]:
        raise InputError(
            f"{path.name}: profile {profile_id}: from_minimum_frames must rise by 1 from below 0 to above 0"
        )

    def column(name: str) -> Array | None:
        values = pd.to_numeric(rows[name], errors="coerce").to_numpy(dtype=np.float64)
        # A column that is empty throughout means that it was not measured.
        return None if np.isnan(values).all() else values

    closure = column("closure")
    if closure is None:
        raise InputError(f"{path.name}: profile {profile_id} has no closure")
    eye = rows["eye"].iloc[0]
    return BlinkProfile(
        profile_id=profile_id,
        closure=closure,
        closure_other=column("closure_other"),
        lower_up_mm=column("lower_up_mm"),
        lower_nasal_mm=column("lower_nasal_mm"),
        minimum_index=int(-offset[0]),
        down_frames=int(-offset[0]),
        up_frames=int(offset[-1]),
        # The amplitude has no column: it is the range of the closure.
        amplitude=float(np.ptp(closure)),
        source=f"profile table {path.name}",
        # An empty cell is read as NaN, not as text.
        eye=EYES.get(str(eye) if isinstance(eye, str) else ""),
        recording=path.stem,
        fps=PROFILE_FPS,
    )
