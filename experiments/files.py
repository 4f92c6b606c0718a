"""Output that is whole or absent: written under a temporary name beside the target, then renamed."""

import errno
import json
import math
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, TextIO

from experiments.command_line import NO_ROOM
from experiments.errors import InputError


def temporary_beside(path: Path, suffix: str = "") -> Path:
    """Return a name beside `path` for unfinished output; the folder must exist and be writable."""
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path}: the folder {folder} does not exist; make it first")
    if path.is_dir():
        raise InputError(f"{path}: expected a file name, this is a folder")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path}: the folder {folder} cannot be written to")
    return folder / f".{path.name}.{os.getpid()}.part{suffix}"


def check_targets(outputs: Iterable[Path | None], inputs: Iterable[Path | None] = ()) -> None:
    """Refuse outputs that cannot be written, or would take the place of an input or of one another."""
    taken = [path.resolve() for path in inputs if path is not None]
    for path in outputs:
        if path is not None:
            temporary_beside(path)
            if path.resolve() in taken:
                raise InputError(f"{path}: already in use in this call; give every output a name of its own")
            taken.append(path.resolve())


def check_ending(path: Path | None, endings: tuple[str, ...], what: str) -> None:
    """Refuse a name for output whose ending is not one of its kind; a name without an ending is refused too.

    Parameters
    ----------
    path : Path or None
        None is no output.
    endings : tuple of str
        Expected, with their dots, in small letters.
    what : str
        The output in words, as `a track`, or its option.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise InputError(f"{what}: expected a name that ends in {' or '.join(endings)}, got '{path.name}'")


def remove_quietly(path: Path) -> None:
    """Remove `path` if it is there."""
    with suppress(OSError):
        path.unlink()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path; rename it to `path` if the block ends well, remove it if not.

    Raises
    ------
    InputError
        The file cannot stand there, or the disk is full.
    """
    temporary = temporary_beside(path, suffix=path.suffix)
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.errno in NO_ROOM:
            raise InputError(
                f"{path} cannot be written ({error.strerror}); make room and try again"
            ) from error
        if error.filename == str(temporary):
            raise InputError(f"{path} cannot be written ({error.strerror}); write it elsewhere") from error
        raise
    finally:
        remove_quietly(temporary)


def says_full(error: Exception) -> bool:
    """Whether an error, or that which `whole_file` made it of, says that the disk is full."""
    cause = error if isinstance(error, OSError) else error.__cause__
    return isinstance(cause, OSError) and cause.errno == errno.ENOSPC


@contextmanager
def whole_text(path: Path) -> Iterator[TextIO]:
    """Open `path` for text (UTF-8, newlines as written) so that it appears whole or not at all."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        yield stream


@contextmanager
def whole_private_file(path: Path) -> Iterator[IO[bytes]]:
    """As `whole_file`, open for bytes: for its owner alone, and on the disk before it stands there."""
    with whole_file(path) as temporary:
        remove_quietly(temporary)  # of a process that was killed and had this one's number
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())


# JSON of numbers: what is undefined or infinite becomes null.


def json_text(value: Any) -> str:
    """Indented JSON; JSON has no NaN, so what is undefined or infinite becomes null.

    Parameters
    ----------
    value : Any
        Dictionaries, lists, tuples, text, numbers and None, in any depth.

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


# The address of a database as its owner writes it, and as SQLAlchemy needs it.

DRIVER = "postgresql+psycopg://"


def with_driver(url: str) -> str:
    """The address with the driver that this project uses, where it names PostgreSQL and no driver.

    Examples
    --------
    >>> with_driver("postgres://host/name")
    'postgresql+psycopg://host/name'
    """
    for prefix in ("postgres://", "postgresql://"):
        if url.startswith(prefix):
            return DRIVER + url.removeprefix(prefix)
    return url
