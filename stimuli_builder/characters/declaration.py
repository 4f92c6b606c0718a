"""`character.toml`: what a folder of pictures must say to be a character, and how one is written."""

import hashlib
import tomllib
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from experiments.errors import InputError, wrong_value
from experiments.files import whole_file

# `character.toml`: what a folder of pictures must say to be a character (docs/explanation/characters.md).

REPAIR = "restore the complete file, or bake the character again"
"""What to do about a character's file that is missing or damaged; its pictures may be of anybody's making."""
DECLARATION_FILE = "character.toml"
Closure = Annotated[float, Field(ge=0.0, le=1.0)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class _Declared(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Picture(_Declared):
    """One picture file of the atlas, named relative to the character's folder."""

    file: str
    sha256: Sha256 | None = None

    @model_validator(mode="after")
    def _stays_in_folder(self) -> "Picture":
        # A character may come from a stranger: its files must not point elsewhere on the disk.
        if Path(self.file).is_absolute() or ".." in Path(self.file).parts:
            raise ValueError(f"file '{self.file}' must be inside the character's folder")
        return self


class PictureOrFrame(Picture):
    """A separate picture, or, if `file` is a video, its frame number `frame`, from 0."""

    frame: int | None = Field(None, ge=0)


class Level(PictureOrFrame):
    """The crop as it looks at one eyelid closure (0 open, 1 closed)."""

    closure: Closure


class LowerLidPose(PictureOrFrame):
    """The lower lid's region of the open-eye frame with the lower lid moved.

    `vertical_mm` is up, `horizontal_mm` toward the nose, both of the lid's center.
    """

    vertical_mm: float
    horizontal_mm: float


class LowerLid(_Declared):
    """The lower-lid layer: poses of the open eye and mattes of what covers the lower lid.

    A matte is a gray picture of the layer's region: 1 (white) where upper lid or upper lashes hide the
    lower lid at that closure. `crop` is x, y, width, height in px of the full frame.
    """

    crop: tuple[int, int, int, int]
    poses: tuple[LowerLidPose, ...] = Field(min_length=4)
    mattes: tuple[Level, ...] = Field(min_length=1)

    @property
    def vertical_mm(self) -> tuple[float, ...]:
        """The vertical positions baked, ascending, in mm."""
        # A set first: the grid has every vertical position once for each horizontal one.
        return tuple(sorted({pose.vertical_mm for pose in self.poses}))

    @property
    def horizontal_mm(self) -> tuple[float, ...]:
        """The horizontal positions baked, ascending, in mm."""
        return tuple(sorted({pose.horizontal_mm for pose in self.poses}))

    @model_validator(mode="after")
    def _full_grid(self) -> "LowerLid":
        given = sorted((pose.vertical_mm, pose.horizontal_mm) for pose in self.poses)
        # Poses between those baked are interpolated in both directions, which needs a full grid.
        needed = sorted((v, h) for v in self.vertical_mm for h in self.horizontal_mm)
        if given != needed:
            raise ValueError("lower_lid.poses must have every pair of vertical_mm and horizontal_mm once")
        # The lower lid at rest must be a picture, not a mixture of poses.
        if 0.0 not in self.vertical_mm or 0.0 not in self.horizontal_mm:
            raise ValueError("lower_lid.poses must include the resting pose (vertical_mm 0, horizontal_mm 0)")
        # A video is compressed in color; the gray of a matte is an amount and must be exact.
        if any(matte.frame is not None for matte in self.mattes):
            raise ValueError(
                "lower_lid.mattes must be pictures; only base, levels and poses may be frames of a video"
            )
        _require_ascending([matte.closure for matte in self.mattes], "lower_lid.mattes")
        return self


class Declaration(_Declared):
    """The whole of `character.toml`; lengths in mm on the screen at actual size, positions in px.

    `version` counts the bakes of a name that were given to others: pictures that changed have another and are
    a separate character, `alder@2`; poses of the lower lid added to a character count further.
    """

    # Names are folders and parts of addresses, on every file system.
    name: str = Field(pattern="^[a-z0-9][a-z0-9_-]*(@[1-9][0-9]{0,3})?$")
    version: int = Field(1, ge=1)
    label: str
    size_px: tuple[Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]]
    px_per_mm: float = Field(gt=0)
    inter_ocular_mm: float = Field(gt=0)
    opening_mm: float = Field(gt=0)
    crop: tuple[int, int, int, int]
    base: PictureOrFrame
    levels: tuple[Level, ...] = Field(min_length=2)
    lower_lid: LowerLid | None = None
    provenance: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _version_named(self) -> "Declaration":
        _, _, named = self.name.partition("@")
        # More is possible: poses added later raise the version, but not the name.
        if named and self.version < int(named):
            raise ValueError(f"version of '{self.name}' must be {named} or more; it is {self.version}")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> "Declaration":
        closures = [level.closure for level in self.levels]
        _require_ascending(closures, "levels")
        # Closures outside the range of the levels could not be interpolated.
        if closures[0] != 0.0 or closures[-1] != 1.0:
            raise ValueError("levels must run from closure 0 (open) to closure 1 (closed)")
        _require_inside(self.crop, self.size_px, "crop")
        if self.lower_lid is not None:
            _require_inside(self.lower_lid.crop, self.size_px, "lower_lid.crop")
            _require_nested(self.lower_lid.crop, self.crop)
        return self


def _require_ascending(closures: list[float], where: str) -> None:
    if any(b <= a for a, b in pairwise(closures)):
        raise ValueError(f"{where} must be in ascending order of closure, each closure once")


def _require_inside(crop: tuple[int, int, int, int], size: tuple[int, int], where: str) -> None:
    x, y, width, height = crop
    if min(x, y) < 0 or min(width, height) < 1 or x + width > size[0] or y + height > size[1]:
        raise ValueError(
            f"{where} {list(crop)} (x, y, width, height) must be inside the {list(size)} px frame"
        )


def _require_nested(inner: tuple[int, int, int, int], outer: tuple[int, int, int, int]) -> None:
    if (
        inner[0] < outer[0]
        or inner[1] < outer[1]
        or inner[0] + inner[2] > outer[0] + outer[2]
        or inner[1] + inner[3] > outer[1] + outer[3]
    ):
        raise ValueError("lower_lid.crop must be inside crop")


def read_declaration(folder: Path) -> Declaration:
    """Read and check a character folder's declaration.

    Raises
    ------
    InputError
        The folder or its declaration is missing, not TOML, or breaks a rule; the line names the rule.
    """
    file = folder / DECLARATION_FILE
    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{folder} is not a character: its {DECLARATION_FILE} is not UTF-8 text; {REPAIR}"
        ) from error
    except OSError as error:
        raise InputError(f"{folder} is not a character: it has no readable {DECLARATION_FILE}") from error
    try:
        return Declaration.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file} is not TOML: {error}; correct that line") from error
    except ValidationError as error:
        raise InputError(
            f"{file}: {_first_fault(error)}; correct it (docs/how-to/own-character.md) or bake it again if "
            "another version of Palpebra wrote it"
        ) from error


def _first_fault(error: ValidationError) -> str:
    # One fault at a time: the first often causes the others.
    fault = error.errors()[0]
    where = ".".join(str(part) for part in fault["loc"])
    return f"{where}: {wrong_value(fault)}" if where else wrong_value(fault)


def declaration_toml(declaration: Declaration) -> str:
    """Write a declaration as TOML text; reading it back gives an equal declaration."""
    # None has no form in TOML; a key that is left out reads as its default.
    content = declaration.model_dump(exclude_none=True)
    # Tables must come after all plain keys, or these would belong to the last table.
    tables = {key: content.pop(key) for key in ("levels", "lower_lid", "provenance") if key in content}
    lines = [f"{key} = {_toml_value(value)}" for key, value in content.items()]
    for level in tables["levels"]:
        lines += ["", "[[levels]]", *_toml_pairs(level)]
    lower = tables.get("lower_lid")
    if lower:
        lines += ["", "[lower_lid]", f"crop = {_toml_value(lower['crop'])}"]
        for key in ("poses", "mattes"):
            for item in lower[key]:
                lines += ["", f"[[lower_lid.{key}]]", *_toml_pairs(item)]
    if tables.get("provenance"):
        lines += ["", "[provenance]", *_toml_pairs(tables["provenance"])]
    return "\n".join(lines) + "\n"


def _toml_pairs(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {_toml_value(value)}" for key, value in table.items()]


def _toml_value(value: Any) -> str:
    # Before int, of which bool is a kind.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        # The backslash first, or it would escape those that are added for quotes.
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(_toml_pairs(value)) + " }"
    return "[" + ", ".join(_toml_value(item) for item in value) + "]"


# Write a character's folder: pictures first, the declaration last, so a half-written one never loads.


def write_bytes(file: Path, content: bytes) -> None:
    """Write a file whole."""
    with whole_file(file) as temporary:
        temporary.write_bytes(content)


def write_picture(folder: Path, file: str, image: NDArray[np.uint8]) -> Picture:
    """Write (h, w, 3) or (h, w) code values as lossless WebP; return what the declaration says of it."""
    buffer = BytesIO()
    # With `lossless` quality is the effort of compression, not a loss.
    Image.fromarray(image).convert("RGB").save(buffer, "WEBP", lossless=True, quality=90, method=4)
    return write_bytes_declared(folder, file, buffer.getvalue())


def write_bytes_declared(folder: Path, file: str, content: bytes) -> Picture:
    """Write a file of the atlas; return what the declaration says of it."""
    write_bytes(folder / file, content)
    return Picture(file=file, sha256=hashlib.sha256(content).hexdigest())


def write_declaration(folder: Path, declaration: Declaration) -> None:
    """Write `character.toml`, which makes the folder a character."""
    write_bytes(folder / DECLARATION_FILE, declaration_toml(declaration).encode())


# The smallest character there can be: what a lab with its own pictures writes (docs/how-to/own-character.md).

WIDTH, HEIGHT = 48, 24
CROP = (4, 4, 40, 16)
CLOSURES = (0.0, 0.25, 0.5, 1.0)


def draw_crop(closure: float, lift: int = 0) -> NDArray[np.uint8]:
    """Gray skin with one dark eye: the lid covers it from above, the lower lid lifts by whole pixels."""
    # Integers only: the pictures have the same bytes everywhere.
    image = np.full((CROP[3], CROP[2], 3), 180, np.uint8)
    top = 2 + round(12 * closure)
    image[top : 14 - lift, 8:32] = (40, 60, 90)
    return image


def write_example_character(folder: Path, lower_lid: bool = True) -> Path:
    """Draw a 48 x 24 px character of four levels (2 x 3 lower-lid poses if wished) and return its folder."""
    levels = [
        Level(closure=w, **write_picture(folder, f"level_{w:.2f}.webp", draw_crop(w)).model_dump())
        for w in CLOSURES
    ]
    frame = np.full((HEIGHT, WIDTH, 3), 180, np.uint8)
    frame[CROP[1] : CROP[1] + CROP[3], CROP[0] : CROP[0] + CROP[2]] = draw_crop(0.0)
    layer = None
    if lower_lid:
        poses = [
            LowerLidPose(
                vertical_mm=v,
                horizontal_mm=h,
                **write_picture(folder, f"pose_{v}_{h}.webp", draw_crop(0.0, int(4 * v))).model_dump(),
            )
            for v in (0.0, 0.5, 1.0)
            for h in (0.0, 1.0)
        ]
        # Two mattes are the least: nothing is covered when open, all is when closed.
        covered = [(w, np.full((CROP[3], CROP[2]), round(255 * w), np.uint8)) for w in (0.0, 1.0)]
        mattes = [
            Level(closure=w, **write_picture(folder, f"matte_{w}.webp", m).model_dump()) for w, m in covered
        ]
        layer = LowerLid(crop=CROP, poses=tuple(poses), mattes=tuple(mattes))
    declaration = Declaration(
        name="tiny",
        label="Tiny test character",
        size_px=(WIDTH, HEIGHT),
        px_per_mm=1.5,
        inter_ocular_mm=16.0,
        opening_mm=8.0,
        crop=CROP,
        base=PictureOrFrame(**write_picture(folder, "open.webp", frame).model_dump()),
        levels=tuple(levels),
        lower_lid=layer,
        provenance={"command": "tests", "versions": {"numpy": "2"}, "samples": 3},
    )
    write_declaration(folder, declaration)
    return folder
