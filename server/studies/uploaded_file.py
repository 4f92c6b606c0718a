"""One file that is uploaded: a name that leads nowhere else, and bytes up to a limit."""

import re
from pathlib import Path, PurePosixPath
from typing import IO, Protocol

from experiments.files import whole_file
from experiments.own_clips import one_form
from server.errors import ApiError, Invalid
from video_conversion.prepared import VIDEO_ENDINGS

TABLES = (".csv", ".json")
CHUNK_BYTES = 1 << 20
NAME = re.compile(r"\w[^\x00-\x1f\x7f]*")


class UploadTooLarge(ApiError):
    """The upload is larger than this server takes."""

    status = 413
    code = "too_large"


def safe_name(path: str) -> str:
    """The file's own name; Invalid where the path climbs out or is not a clip or table."""
    pure = PurePosixPath(path.replace("\\", "/"))
    if pure.is_absolute() or ".." in pure.parts or not pure.name or pure.name.startswith("."):
        raise Invalid(f"The file '{path[:100]}' has a path that is not allowed; expected plain file names.")
    if pure.suffix.lower() not in VIDEO_ENDINGS + TABLES:
        raise Invalid(
            f"The file '{pure.name[:100]}' is neither a video ({', '.join(VIDEO_ENDINGS)}) nor a CSV table."
        )
    if len(pure.name) > 150:
        raise Invalid(f"The file name '{pure.name[:100]}...' is too long; 150 characters are the most.")
    name = one_form(pure.name)
    if not NAME.fullmatch(name):
        raise Invalid(f"The file name '{name[:100]}' should begin with a letter or digit; rename the file.")
    return name


class Room(Protocol):
    """Bytes that there is room for."""

    def room(self) -> int:
        """Those that may come still."""
        ...

    def check(self) -> None:
        """Look again, once they have come."""
        ...

    def full(self) -> UploadTooLarge:
        """What is said where more come."""
        ...


def copy(source: IO[bytes], target: Path, limit: int, called: str = "", within: Room | None = None) -> None:
    """Store what comes, as a whole or not at all.

    Raises
    ------
    UploadTooLarge
        It is larger than `limit`, said by the name `called`, or than the room.
    """
    written, room = 0, None if within is None else within.room()
    with whole_file(target) as temporary, temporary.open("wb") as stream:
        while piece := source.read(CHUNK_BYTES):
            written += len(piece)
            if written > limit:
                raise UploadTooLarge(
                    f"'{called or target.name}' is larger than the {limit >> 20} MiB accepted."
                )
            if within is not None and room is not None and written > room:
                raise within.full()
            stream.write(piece)
        if within is not None:
            stream.flush()
            within.check()
