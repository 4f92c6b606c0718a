"""Which recordings the shipped library is measured from."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from experiments.errors import InputError
from stimuli_builder.blinks.profile import Eye

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
