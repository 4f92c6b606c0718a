"""What a lab may change about the face: one declared file, `presets.toml`, holds every preset."""

import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from experiments.errors import InputError, did_you_mean

PRESETS_FILE = Path(__file__).with_name("presets.toml")
Colour = tuple[
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=0, le=1)],
]


class _Declared(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Skin(_Declared):
    """Pigments relative to the first preset, and what time does to skin."""

    melanin: float = Field(ge=0.3, le=4, description="1 is fair, 2.5 is brown")
    haemoglobin: float = Field(ge=0.3, le=2, description="1 is ordinary redness")
    freckles: int = Field(ge=0, le=3000, description="spots over the whole picture")
    age_lines: float = Field(ge=0, le=2, description="depth of creases and crow's feet; 1 is about forty")


class Iris(_Declared):
    """Linear-light colours of the iris from limbus to pupil."""

    outer: Colour
    middle: Colour
    inner: Colour


class Hair(_Declared):
    """Lashes and brows: linear-light colours, counts per eye and per brow."""

    lash_colour: Colour
    brow_colour: Colour
    upper_lashes: int = Field(ge=0, le=400)
    lower_lashes: int = Field(ge=0, le=300)
    lash_length: float = Field(gt=0, le=2, description="relative to the first preset")
    brow_hairs: int = Field(ge=0, le=4000)
    brow_height: float = Field(gt=0, le=2, description="thickness of the brow, relative")


class Face(_Declared):
    """One preset. `seed` draws everything random, so that a face is the same at every bake."""

    label: str
    seed: int = Field(ge=0)
    exposure_ev: float = Field(ge=-3, le=3)
    skin: Skin
    iris: Iris
    hair: Hair


def load_presets(file: Path = PRESETS_FILE) -> dict[str, Face]:
    """Every preset of a declared file, by name; InputError names the first fault."""
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read presets from {file}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file} is not TOML: {error}") from error
    return {name: _face(file, name, face) for name, face in content.items()}


def _face(file: Path, name: str, content: object) -> Face:
    try:
        return Face.model_validate(content)
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(str(part) for part in (name, *fault["loc"]))
        raise InputError(f"{file}: {where}: {fault['msg']}") from error


def load_preset(name: str, file: Path = PRESETS_FILE) -> Face:
    """One preset; InputError with the nearest name where there is none."""
    presets = load_presets(file)
    if name not in presets:
        raise InputError(f"no preset '{name}' in {file.name}{did_you_mean(name, presets)}")
    return presets[name]
