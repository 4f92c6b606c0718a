"""Finding a character by name or folder, its geometry, and the hash of all that decides how it looks."""

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from stimuli_builder.characters.atlas import Character
    from stimuli_builder.characters.declaration import LowerLid

CARTOON = "cartoon"
SHIPPED_FOLDER = Path(__file__).resolve().parent.parent / "characters" / "data"


@dataclass(frozen=True)
class Geometry:
    """Size and scale of a character's whole frame, before it is scaled to a clip."""

    name: str
    size_px: tuple[int, int]
    px_per_mm: float
    inter_ocular_mm: float
    opening_mm: float
    lower_range_mm: tuple[tuple[float, float], tuple[float, float]] | None
    """Least and greatest lift, and slide, of the lower lid; None without a lower-lid layer."""

    def scaled(self, width_px: int, height_px: int) -> tuple[tuple[int, int], int]:
        """Size of the whole frame when `width_px` wide, and the rows to cut above to get `height_px`.

        Raises
        ------
        InputError
            The character is less high than that.
        """
        whole = (width_px, round(self.size_px[1] * width_px / self.size_px[0]))
        spare = whole[1] - height_px
        if spare < 0:
            raise InputError(
                f"character '{self.name}' is {whole[1]} px high at a width of {width_px} px; expected a "
                f"height of at most that, got {height_px}"
            )
        return whole, 2 * (spare // 4)

    def px_per_mm_at(self, width_px: int) -> float:
        """Scale of a clip of that width."""
        return self.px_per_mm * width_px / self.size_px[0]


def shipped_names() -> tuple[str, ...]:
    """Names of the characters that come with the project."""
    baked = sorted(file.parent.name for file in SHIPPED_FOLDER.glob("*/character.toml"))
    return (CARTOON, *baked)


def character_folder(name: str, beside: Path | None = None) -> Path:
    """Folder of a baked character given by shipped name or by path, the latter relative to `beside`.

    Raises
    ------
    InputError
        There is no such character; the nearest name is given.
    """
    shipped = SHIPPED_FOLDER / name
    if (shipped / "character.toml").is_file():
        return shipped
    folder = (beside or Path()) / name
    if (folder / "character.toml").is_file():
        return folder.resolve()
    if folder.is_dir():
        raise InputError(f"{folder} is no character: it holds no character.toml (docs/own-character.md)")
    raise InputError(
        f"no character '{name}': neither shipped nor a folder{did_you_mean(name, shipped_names())}"
    )


def find_character(name: str, beside: Path | None = None) -> "Character":
    """Load a baked character by shipped name or folder."""
    from stimuli_builder.characters.atlas import load_character

    return load_character(character_folder(name, beside))


def geometry(name: str, beside: Path | None = None) -> Geometry:
    """Size and scale of a character."""
    if name == CARTOON:
        return _cartoon_geometry()
    return _folder_geometry(character_folder(name, beside))


@lru_cache(maxsize=1)
def _cartoon_geometry() -> Geometry:
    from stimuli_builder.characters import cartoon

    width = 960
    size = (width, round(width * cartoon.FRAME_MM[1] / cartoon.FRAME_MM[0]))
    scale = width / cartoon.FRAME_MM[0]
    return Geometry(CARTOON, size, scale, cartoon.INTER_OCULAR_MM, cartoon.OPENING_MM, None)


@lru_cache(maxsize=16)
def _folder_geometry(folder: Path) -> Geometry:
    from stimuli_builder.characters.atlas import load_character

    found = load_character(folder).declaration
    return Geometry(
        found.name,
        found.size_px,
        found.px_per_mm,
        found.inter_ocular_mm,
        found.opening_mm,
        None if found.lower_lid is None else _ends(found.lower_lid),
    )


def _ends(lid: "LowerLid") -> tuple[tuple[float, float], tuple[float, float]]:
    vertical, horizontal = lid.vertical_mm, lid.horizontal_mm
    return (vertical[0], vertical[-1]), (horizontal[0], horizontal[-1])


def fingerprint(name: str, beside: Path | None = None) -> str:
    """SHA-256 of everything that decides a character's pictures: its files, or the cartoon's source."""
    if name == CARTOON:
        return _cartoon_hash()
    return _folder_hash(character_folder(name, beside))


@lru_cache(maxsize=1)
def _cartoon_hash() -> str:
    from stimuli_builder.characters import cartoon

    return cartoon.fingerprint()


@lru_cache(maxsize=16)
def _folder_hash(folder: Path) -> str:
    from stimuli_builder.characters.declaration import read_declaration

    declaration = read_declaration(folder)
    pictures = [declaration.base, *declaration.levels]
    if declaration.lower_lid is not None:
        pictures += [*declaration.lower_lid.poses, *declaration.lower_lid.mattes]
    digest = hashlib.sha256((folder / "character.toml").read_bytes())
    for picture in pictures:
        try:
            digest.update((folder / picture.file).read_bytes())
        except OSError as error:
            raise InputError(
                f"character '{declaration.name}': {picture.file} is missing from {folder}; bake it again"
            ) from error
    return digest.hexdigest()
