"""Output that is whole or absent: written under a temporary name beside the target, then renamed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.errors import InputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; rename it if the block ends well, remove it if not."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")
    if path.is_dir():
        raise InputError(f"{path}: expected a file name, this is a folder")
    temporary = path.parent / f".{path.name}.{os.getpid()}.part{path.suffix}"
    try:
        yield temporary
        temporary.replace(path)
    except PermissionError as error:
        raise InputError(f"{path}: the folder {path.parent} cannot be written to") from error
    finally:
        temporary.unlink(missing_ok=True)
