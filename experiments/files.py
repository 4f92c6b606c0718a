"""Output that is complete or absent: written under a temporary name next to the target, then renamed."""

import errno
import json
import math
import os
import shlex
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, TextIO

from experiments.command_line import NO_ROOM
from experiments.errors import InputError


def temporary_beside(path: Path, suffix: str = "") -> Path:
    """Return a name next to `path` for unfinished output; folders that are missing are created."""
    check_target(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path.parent / f".{path.name}.{os.getpid()}.part{suffix}"


def check_target(path: Path) -> None:
    """Refuse a file that cannot be written, before the work begins; nothing is created."""
    check_folder(path.parent)
    if path.is_dir():
        raise InputError(f"{path}: expected a file name, got a folder")


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be written to or created, before the work begins; nothing is created."""
    ancestor = existing_part(folder)
    if not ancestor.is_dir():
        raise InputError(f"{folder}: expected a folder, but {ancestor} is a file")
    if not os.access(ancestor, os.W_OK):
        raise InputError(f"{folder}: the folder {ancestor} is not writable")


def existing_part(path: Path) -> Path:
    """A path, or the nearest of the folders above it that exists."""
    return next((one for one in (path, *path.parents) if one.exists()), path)


def check_targets(outputs: Iterable[Path | None], inputs: Iterable[Path | None] = ()) -> None:
    """Refuse outputs that cannot be written, or that would overwrite an input or another output."""
    taken = [path.resolve() for path in inputs if path is not None]
    for path in outputs:
        if path is not None:
            check_target(path)
            if path.resolve() in taken:
                raise InputError(f"{path}: already used in this call; give every output a unique name")
            taken.append(path.resolve())


def check_ending(path: Path | None, endings: tuple[str, ...], what: str) -> None:
    """Refuse an output name with a wrong ending or without an ending.

    Parameters
    ----------
    path : Path or None
        None if there is no output.
    endings : tuple of str
        Expected, with their dots, in small letters.
    what : str
        The output in words, such as `a track`, or its option.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise InputError(f"{what}: expected a name that ends in {' or '.join(endings)}, got '{path.name}'")


def as_argument(path: Path | str) -> str:
    """A file as it is written in a command for a shell; `./` before a name that would be read as an option.

    Examples
    --------
    >>> as_argument("my ratings.csv"), as_argument("-1.csv")
    ("'my ratings.csv'", './-1.csv')
    """
    name = str(path)
    return shlex.quote(f".{os.sep}{name}" if name.startswith("-") else name)


def remove_quietly(path: Path) -> None:
    """Remove `path` if it is there."""
    with suppress(OSError):
        path.unlink()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path; rename it to `path` if the block succeeds, remove it otherwise.

    Raises
    ------
    InputError
        The file cannot be written there, or the disk is full.
    """
    temporary = temporary_beside(path, suffix=path.suffix)
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.errno in NO_ROOM:
            raise InputError(
                f"{path} cannot be written ({error.strerror}); free disk space and try again"
            ) from error
        if error.filename == str(temporary):
            raise InputError(
                f"{path} cannot be written ({error.strerror}); choose a different location"
            ) from error
        raise
    finally:
        remove_quietly(temporary)


def says_full(error: Exception) -> bool:
    """Whether an error, or the one that caused it in `whole_file`, reports a full disk."""
    cause = error if isinstance(error, OSError) else error.__cause__
    return isinstance(cause, OSError) and cause.errno == errno.ENOSPC


@contextmanager
def whole_text(path: Path) -> Iterator[TextIO]:
    """Open `path` for text (UTF-8, newlines as written) so that it appears completely or not at all."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        yield stream


@contextmanager
def whole_private_file(path: Path) -> Iterator[IO[bytes]]:
    """As `whole_file`, open for bytes: readable by its owner only, and on the disk before it is renamed."""
    with whole_file(path) as temporary:
        remove_quietly(temporary)  # left by a killed process with the same process ID
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())


# JSON of numbers: undefined and infinite numbers become null.


def json_text(value: Any) -> str:
    """Indented JSON; undefined and infinite numbers become null, because JSON has no NaN.

    Parameters
    ----------
    value : Any
        Dictionaries, lists, tuples, text, numbers and None, at any depth.

    Returns
    -------
    str
        The same text for the same value, ending in a line break.
    """
    return json.dumps(_finite(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# The URL of a database as its owner writes it, and as SQLAlchemy needs it.

DRIVER = "postgresql+psycopg://"


def with_driver(url: str) -> str:
    """The URL with this project's driver, if it names PostgreSQL without a driver.

    Examples
    --------
    >>> with_driver("postgres://host/name")
    'postgresql+psycopg://host/name'
    """
    for prefix in ("postgres://", "postgresql://"):
        if url.startswith(prefix):
            return DRIVER + url.removeprefix(prefix)
    return url
