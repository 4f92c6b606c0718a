"""Read the shipped profile tables."""

from collections.abc import Hashable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from experiments.errors import InputError
from stimuli_builder.blinks.csv_table import read_table
from stimuli_builder.blinks.library.recordings import LIBRARY_FOLDER
from stimuli_builder.blinks.profile import BlinkProfile
from stimuli_builder.blinks.profile_table import read_profile_table


def load_library(*, paired: bool = False) -> tuple[BlinkProfile, ...]:
    """Return the shipped profiles, in the order of the table.

    One profile an eye and blink; with `paired`, the blinks seen in both eyes, left in `closure`, right in
    `closure_other` (the same blinks again).
    """
    chosen = [profile for profile in _shipped() if (profile.closure_other is not None) == paired]
    return tuple(chosen)


@lru_cache(maxsize=1)
def _shipped() -> tuple[BlinkProfile, ...]:
    return read_profiles(LIBRARY_FOLDER / "profiles.csv", LIBRARY_FOLDER / "closures.csv")


def read_profiles(profiles_csv: Path, closures_csv: Path) -> tuple[BlinkProfile, ...]:
    """Read the library's table of profiles with the samples that belong to it (`stimuli profiles build`)."""
    samples = {profile.profile_id: profile for profile in read_profile_table(closures_csv)}
    rows = read_table(profiles_csv).to_dict("records")
    try:
        return tuple(_with_origin(samples[str(row["profile_id"])], row) for row in rows)
    except (KeyError, ValueError) as error:
        raise InputError(
            f"{profiles_csv.name} and {closures_csv.name} do not belong together ({error}); "
            "`stimuli profiles build` writes both"
        ) from error


def _with_origin(profile: BlinkProfile, row: Mapping[Hashable, Any]) -> BlinkProfile:
    return replace(
        profile,
        amplitude=float(row["amplitude"]),
        source=str(row["source"]),
        recording=str(row["recording"]),
        rest_before=float(row["rest_before"]),
        rest_after=float(row["rest_after"]),
    )
