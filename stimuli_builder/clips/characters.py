"""Find a character by name or folder and keep its levels; what reads or draws it is loaded when asked for."""

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.errors import InputError, did_you_mean
from stimuli_builder.characters.atlas import load_retired
from stimuli_builder.clips.geometry import AS_BAKED, Character, Geometry, Movement

if TYPE_CHECKING:
    from stimuli_builder.clips.levels import LevelSet

SHIPPED_FOLDER = Path(__file__).resolve().parent.parent / "characters" / "data"


def shipped_names() -> tuple[str, ...]:
    """Names of the characters that come with the project."""
    baked = sorted(file.parent.name for file in SHIPPED_FOLDER.glob("*/character.toml"))
    return (*DRAWN, *baked)


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
    if name in load_retired():
        raise InputError(
            f"character '{name}' is no longer shipped. Restore it for existing studies with `stimuli "
            f"character fetch {name}`; for a new study use another, such as '{_successor(name)}'"
        )
    if folder.is_dir():
        raise InputError(
            f"{folder} is not a character: it has no character.toml (docs/how-to/own-character.md)"
        )
    raise InputError(
        f"there is no character '{name}': it is neither shipped nor a "
        f"folder{did_you_mean(name, shipped_names())}"
    )


def _successor(name: str) -> str:
    """The newest shipped character of the same name; of names that left, one with a moving lower lid."""
    of_name = [one for one in shipped_names() if one.partition("@")[0] == name.partition("@")[0]]
    return max(of_name, key=lambda one: int(one.partition("@")[2] or 1), default="alder@8")


def find_character(name: str, beside: Path | None = None) -> Character:
    """The character of a shipped name, or of a folder relative to `beside`."""
    if name in DRAWN:
        return _drawn(name)
    return _baked(character_folder(name, beside))


def geometry(name: str, beside: Path | None = None) -> Geometry:
    """Size and scale of a character."""
    return find_character(name, beside).geometry


def fingerprint(name: str, beside: Path | None = None) -> str:
    """SHA-256 of everything that decides a character's pictures: its files, or the drawing's source."""
    return find_character(name, beside).fingerprint


@lru_cache(maxsize=3)
def _drawn(name: str) -> Character:
    from stimuli_builder.clips.character_levels import DRAWN_LOOKS, CartoonCharacter

    return CartoonCharacter(DRAWN_LOOKS[name])


@lru_cache(maxsize=16)
def _baked(folder: Path) -> Character:
    from stimuli_builder.clips.character_levels import BakedCharacter

    return BakedCharacter(folder)


DRAWN = ("cartoon", "cartoon-willow", "cartoon@2")
"""Characters that are drawn by a program; every other is a folder of pictures."""


# The levels that a process keeps while it renders: the last characters at their sizes and movements.

ROOMY_WIDTH_PX = 1200
"""Up to this width a process keeps two characters; two at the largest size would pass 1.5 GB."""


@lru_cache(maxsize=2)
def kept_levels(
    character: str,
    fingerprint: str,  # noqa: ARG001 - part of the key: a character baked again is read again
    size_px: tuple[int, int],
    beside: Path | None,
    movement: Movement = AS_BAKED,
) -> "LevelSet":
    """A character (a name, or a folder relative to `beside`) at a picture size, (width, height), as it moves.

    The last two are kept; at great sizes only the last one.
    """
    import cv2

    from stimuli_builder.clips.face_movement import moved_levels

    # Every core is already used by a separate process.
    cv2.setNumThreads(1)
    if size_px[0] > ROOMY_WIDTH_PX:
        # Cleared before the next is read: two of this size at once would take too much memory.
        kept_levels.cache_clear()
    shown = find_character(character, beside)
    return moved_levels(shown.levels(size_px), shown.geometry, movement)
