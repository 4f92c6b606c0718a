"""Measure the shipped library again from its recordings."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from experiments.errors import InputError
from experiments.files import whole_file
from stimuli_builder.blinks.blink_model import BlinkModel
from stimuli_builder.blinks.both_eyes import all_profiles
from stimuli_builder.blinks.extract import blinks_of
from stimuli_builder.blinks.labelling import LabelOptions, preset
from stimuli_builder.blinks.library import LIBRARY_FOLDER, Recording
from stimuli_builder.blinks.profile import BlinkProfile, write_profile_table
from stimuli_builder.blinks.series import read_series

PROFILE_COLUMNS = (
    "profile_id",
    "recording",
    "person",
    "eye",
    "fps",
    "samples",
    "minimum_index",
    "down_frames",
    "up_frames",
    "amplitude",
    "rest_before",
    "rest_after",
    "source",
    "licence",
)


LIBRARY_OPTIONS = preset("relative")
"""The shipped profiles keep the values they were first measured with: the clips of Exp 1-3 rest on them."""


def recorded_profiles(
    recording: Recording, data: Path | None, options: LabelOptions = LIBRARY_OPTIONS
) -> list[BlinkProfile]:
    """Label one recording and return its profiles."""
    folders = ([] if data is None else [data]) + [LIBRARY_FOLDER]
    path = next((folder / recording.file for folder in folders if (folder / recording.file).is_file()), None)
    if path is None:
        raise InputError(
            f"recording {recording.name}: {recording.file} is not in {data}; give its folder with --data"
        )
    eyes = [
        blinks_of(series, options)
        for series in read_series(path, list(recording.columns.values()), recording.fps)
    ]
    profiles = all_profiles(eyes, recording.name, list(recording.columns))
    if recording.keep_lower_lid:
        return profiles
    return [replace(profile, lower_up_mm=None, lower_nasal_mm=None) for profile in profiles]


def write_profiles(
    folder: Path, profiles: Sequence[BlinkProfile], recordings: Sequence[Recording]
) -> tuple[Path, Path]:
    """Write profiles.csv (one row per profile) and closures.csv (one row per sample at 300 fps)."""
    by_name = {recording.name: recording for recording in recordings}
    rows = [_row(profile, by_name[profile.recording]) for profile in profiles]
    table, closures = folder / "profiles.csv", folder / "closures.csv"
    write_profile_table(closures, profiles)
    with whole_file(table) as partial:
        pd.DataFrame(rows, columns=list(PROFILE_COLUMNS)).to_csv(partial, index=False, lineterminator="\n")
    return table, closures


def write_model(folder: Path, profiles: Sequence[BlinkProfile], components: int = 5) -> BlinkModel:
    """Fit the model to the one-eye profiles and write model.json."""
    model = BlinkModel.fit([p for p in profiles if p.closure_other is None], components)
    model.save(folder / "model.json")
    return model


def _row(profile: BlinkProfile, recording: Recording) -> dict[str, object]:
    return {
        "profile_id": profile.profile_id,
        "recording": profile.recording,
        "person": recording.person,
        "eye": profile.eye,
        "fps": profile.fps,
        "samples": profile.closure.size,
        "minimum_index": profile.minimum_index,
        "down_frames": profile.down_frames,
        "up_frames": profile.up_frames,
        "amplitude": profile.amplitude,
        "rest_before": profile.rest_before,
        "rest_after": profile.rest_after,
        "source": profile.source,
        "licence": recording.licence,
    }
