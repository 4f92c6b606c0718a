"""Profiles on disk: one row a sample at 300 fps, its place counted from the blink's minimum."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.errors import InputError
from experiments.files import whole_file
from stimuli_builder.blinks.csv_table import few, read_table, write_table
from stimuli_builder.blinks.profile import PROFILE_FPS, Array, BlinkProfile, Eye

EYES: dict[str, Eye | None] = {"left": "left", "right": "right", "both": "both", "": None}
TABLE_COLUMNS = {
    "profile_id": "name of the profile",
    "eye": "left, right, both (closure is the left eye's, closure_other the right one's) or empty",
    "from_minimum_frames": "place in frames at 300 fps from the minimum; the first sample is the onset",
    "closure": "0 open, 1 closed",
    "closure_other": "the same for the right eye where both were measured, else empty",
    "lower_up_mm": "lower lid's lift in mm where it was measured, else empty",
    "lower_nasal_mm": "lower lid's slide towards the nose in mm where it was measured, else empty",
}


def write_profile_table(path: Path, profiles: Sequence[BlinkProfile]) -> None:
    """Write profiles as a CSV of `TABLE_COLUMNS`; onset and end are the first and last sample."""
    samples = [_samples(profile) for profile in profiles] or [pd.DataFrame(columns=list(TABLE_COLUMNS))]
    with whole_file(path) as partial:
        write_table(partial, pd.concat(samples))


def _samples(profile: BlinkProfile) -> pd.DataFrame:
    part = slice(profile.onset_index, profile.end_index + 1)

    def column(values: Array | None) -> Array:
        absent = np.full(profile.closure.size, np.nan)
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
                f"{path.name} is no table of profiles (NAME.profiles.csv of `stimuli blinks`): "
                f"it lacks the column '{name}' and has {there}"
            )
    groups = table.groupby("profile_id", sort=False)
    return [_profile(str(name), group, path) for name, group in groups]


def _profile(profile_id: str, rows: pd.DataFrame, path: Path) -> BlinkProfile:
    offset = rows["from_minimum_frames"].to_numpy()
    if offset.dtype.kind != "i" or (np.diff(offset) != 1).any() or not offset[0] < 0 < offset[-1]:
        raise InputError(
            f"{path.name}: profile {profile_id}: from_minimum_frames must rise by 1 from below 0 to above 0"
        )

    def column(name: str) -> Array | None:
        values = pd.to_numeric(rows[name], errors="coerce").to_numpy(dtype=np.float64)
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
        amplitude=float(np.ptp(closure)),
        source=f"profile table {path.name}",
        eye=EYES.get(str(eye) if isinstance(eye, str) else ""),
        recording=path.stem,
        fps=PROFILE_FPS,
    )
