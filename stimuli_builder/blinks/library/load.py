"""Read the shipped profile tables."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.errors import InputError
from stimuli_builder.blinks.library.recordings import LIBRARY_FOLDER
from stimuli_builder.blinks.profile import Array, BlinkProfile


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


def recorded_rests() -> Array:
    """(n, 2) closure of the resting eye before and after each shipped eye profile, to vary made blinks by."""
    return np.array([[profile.rest_before, profile.rest_after] for profile in load_library()])


def read_profiles(profiles_csv: Path, closures_csv: Path) -> tuple[BlinkProfile, ...]:
    """Read a table of profiles and the closures that belong to it, see `stimuli profiles build`."""
    try:
        rows = pd.read_csv(profiles_csv, keep_default_na=False)
        samples = pd.read_csv(closures_csv)
        closures = {str(name): group for name, group in samples.groupby("profile_id", sort=False)}
        return tuple(_profile(row, closures[str(row["profile_id"])]) for row in rows.to_dict("records"))
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read ({error.strerror})") from error
    except InputError:
        raise
    except (KeyError, ValueError) as error:
        raise InputError(
            f"{profiles_csv.name} and {closures_csv.name} do not belong together ({error}); "
            "`stimuli profiles build` writes both"
        ) from error


def _profile(row: dict[str, object], samples: pd.DataFrame) -> BlinkProfile:
    other = samples["closure_other"].to_numpy(dtype=np.float64)
    eye = str(row["eye"])
    return BlinkProfile(
        profile_id=str(row["profile_id"]),
        closure=samples["closure"].to_numpy(dtype=np.float64),
        minimum_index=int(str(row["minimum_index"])),
        down_frames=int(str(row["down_frames"])),
        up_frames=int(str(row["up_frames"])),
        amplitude=float(str(row["amplitude"])),
        source=str(row["source"]),
        eye="left" if eye == "left" else "right" if eye == "right" else "both" if eye == "both" else None,
        recording=str(row["recording"]),
        closure_other=None if np.isnan(other).any() else other,
        rest_before=float(str(row["rest_before"])),
        rest_after=float(str(row["rest_after"])),
        fps=int(str(row["fps"])),
    )
