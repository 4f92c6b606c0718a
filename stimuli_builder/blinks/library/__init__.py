"""The blink profiles that ship with the project, measured from real recordings."""

import tomllib
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from experiments.errors import InputError
from stimuli_builder.blinks.csv_table import read_table
from stimuli_builder.blinks.profile import BlinkProfile, Eye, read_profile_table

# Which recordings the shipped library is measured from.

LIBRARY_FOLDER = Path(__file__).parent
RECORDINGS_FILE = LIBRARY_FOLDER / "recordings.toml"
_EYES: dict[str, Eye | None] = {"left": "left", "right": "right", "one": None}


@dataclass(frozen=True)
class Recording:
    """One recording: file, column of each eye, rate (None: from time_s), who is seen, and rights.

    Attributes
    ----------
    keep_lower_lid : bool
        Whether the lower lid's motion in a track is good enough to be kept.
    """

    name: str
    file: str
    fps: float | None
    columns: dict[Eye | None, str]
    person: str
    source: str
    licence: str
    keep_lower_lid: bool


def read_recordings(path: Path = RECORDINGS_FILE) -> list[Recording]:
    """Read the list of recordings; every entry must be complete."""
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8"))["recording"]
        return [_recording(entry) for entry in entries]
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: each [[recording]] needs name, file, columns, person, source, licence; {error}"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not TOML: {error}") from error


def _recording(entry: dict[str, object]) -> Recording:
    columns = entry["columns"]
    if not isinstance(columns, dict) or not columns:
        raise TypeError("columns must be a table such as { left = 'EAR_l', right = 'EAR_r' }")
    fps = entry.get("fps")
    return Recording(
        name=str(entry["name"]),
        file=str(entry["file"]),
        fps=float(fps) if isinstance(fps, int | float) else None,
        columns={_EYES[eye]: str(column) for eye, column in columns.items()},
        person=str(entry["person"]),
        source=str(entry["source"]),
        licence=str(entry["licence"]),
        keep_lower_lid=bool(entry.get("keep_lower_lid", True)),
    )


def load_library(*, paired: bool = False) -> tuple[BlinkProfile, ...]:
    """Return the shipped profiles, in the order of the table.

    One profile per eye and blink; with `paired`, the blinks seen in both eyes, left in `closure`, right in
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
            f"{profiles_csv.name} and {closures_csv.name} do not belong together ({error}); write both with "
            "`stimuli profiles build`"
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


# The blink profiles that ship with the project, measured from real recordings.

__all__ = ["LIBRARY_FOLDER", "load_library"]
