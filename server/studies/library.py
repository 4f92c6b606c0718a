"""The shipped blinks and the characters at closures, for the blinks page."""

import json
from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field, ValidationError

from server.accounts.access import Viewer
from server.core.errors import ERROR_RESPONSES, NotFound
from server.core.requests import SettingsDep
from table_files.delimited import delimited_table

# The shipped blinks, recorded and modeled, read from the files that come with `stimuli`.

blink_router = APIRouter(prefix="/api/admin/blinks", tags=["blinks"], responses=ERROR_RESPONSES)


class RecordedProfile(BaseModel):
    """One recorded blink at 300 fps: of one eye, or of both on common samples."""

    profile_id: str
    recording: str
    person: str
    eye: str = Field(description="left, right, both (`closure` is the left eye's), or empty where unknown.")
    down_frames: int
    up_frames: int
    amplitude: float
    minimum_index: int
    source: str
    licence: str
    closure: list[float] = Field(description="Closure per frame at `fps`: 0 open, 1 closed.")
    closure_other: list[float] = Field(description="The right eye's where `eye` is both; else empty.")


class BlinkLibrary(BaseModel):
    """The recorded profiles, and the PCA model as `stimuli model fit` wrote it."""

    fps: float
    profiles: list[RecordedProfile]
    model: dict[str, Any]


@blink_router.get("/library")
def get_library(settings: SettingsDep, _identity: Viewer) -> BlinkLibrary:
    """Recorded profiles and the PCA model."""
    folder = settings.library_folder
    if not (folder / "profiles.csv").is_file():
        raise NotFound("The blink library is not on this server.")
    return _library(folder, (folder / "profiles.csv").stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _library(folder: Path, _changed_ns: int) -> BlinkLibrary:
    curves: dict[str, list[float]] = defaultdict(list)
    others: dict[str, list[float]] = defaultdict(list)
    for _, row in delimited_table(folder / "closures.csv").named_rows().rows:
        curves[row["profile_id"]].append(float(row["closure"]))
        if row.get("closure_other"):
            others[row["profile_id"]].append(float(row["closure_other"]))
    profiles = [
        RecordedProfile.model_validate(
            {name: row[name] for name in RecordedProfile.model_fields if name in row}
            | {"closure": curves[row["profile_id"]], "closure_other": others[row["profile_id"]]}
        )
        for _, row in delimited_table(folder / "profiles.csv").named_rows().rows
    ]
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    return BlinkLibrary(fps=float(model.get("fps", 300)), profiles=profiles, model=model)


# The characters at closures from open to shut, for the blinks page: files that `stimuli strips` wrote.

strip_router = APIRouter(prefix="/api/admin/blinks/strips", tags=["blinks"], responses=ERROR_RESPONSES)
STRIPS_FILE = "strips.json"


class Strips(BaseModel):
    """Picture strips, one per character: frames of one size, one below the other."""

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    closures: list[float] = Field(description="Closure of each frame, ascending: 0 open, 1 shut.")
    characters: list[str] = Field(description="Their pictures are at …/strips/NAME.webp.")


@strip_router.get("")
def get_strips(settings: SettingsDep, _identity: Viewer) -> Strips:
    """What strips there are; none where they have not been made on this server."""
    strips = _declared_strips(settings.strips_folder)
    return strips or Strips(width_px=1, height_px=1, closures=[], characters=[])


@strip_router.get("/{name}.webp", response_class=Response)
def get_strip(settings: SettingsDep, _identity: Viewer, name: str) -> Response:
    """The strip of one character."""
    folder = settings.strips_folder
    strips = _declared_strips(folder)
    if strips is None or name not in strips.characters:
        raise NotFound(
            f"There is no picture strip of '{name}'; run `stimuli strips --out DATA_FOLDER/stimuli/strips`."
        )
    content = (folder / f"{name}.webp").read_bytes()
    return Response(content, media_type="image/webp", headers={"cache-control": "private, no-cache"})


def _declared_strips(folder: Path) -> Strips | None:
    """The declaration; None where there is none, it is not readable or a picture is missing."""
    try:
        declared = Strips.model_validate_json((folder / STRIPS_FILE).read_bytes())
    except (OSError, ValidationError):
        return None
    whole = all((folder / f"{Path(name).name}.webp").is_file() for name in declared.characters)
    return declared if whole else None
