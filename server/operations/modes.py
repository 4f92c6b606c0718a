"""Who may read the data folder: its owner alone."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

from server.settings import Settings

OTHERS = 0o077
"""The rights of group and everybody."""


def own_folders(settings: Settings) -> list[Path]:
    """The folders that a server keeps things in: its own, and the one its hosts share."""
    return list(dict.fromkeys((settings.data_folder, settings.common_folder)))


def open_to_others(folder: Path) -> Iterator[Path]:
    """The folder and everything in it that others than its owner have a right to; links are not followed."""
    if folder.is_dir() and _is_open(folder):
        yield folder
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent, name)
            if not path.is_symlink() and _is_open(path):
                yield path


def _is_open(path: Path) -> bool:
    try:
        return bool(stat.S_IMODE(path.lstat().st_mode) & OTHERS)
    except FileNotFoundError:  # a temporary file that has gone meanwhile
        return False


def close_to_others(settings: Settings) -> None:
    """Take from others what an older version, or another program, left open to them.

    What belongs to another user stays as it is; the doctor tells.
    """
    for path in (one for folder in own_folders(settings) for one in open_to_others(folder)):
        try:
            path.chmod(stat.S_IMODE(path.lstat().st_mode) & ~OTHERS)
        except OSError:
            continue
