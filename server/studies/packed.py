"""Zips of own clips: unpacked flat, bounded in number, in size and in what their directory takes."""

import io
import lzma
import zipfile
import zlib
from collections import Counter
from pathlib import Path, PurePosixPath

from experiments.own_clips import check_names
from server.errors import Invalid
from server.studies.uploaded_file import UploadTooLarge, copy, safe_name

_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    NotImplementedError,
    RuntimeError,
    EOFError,
)
"""What unpacking raises by itself; RuntimeError where a file is encrypted."""
MAX_FILES = 5000
MAX_UNPACKED_BYTES = 4 * 1024**3
MAX_RATIO = 200
MAX_DIRECTORY_BYTES = 8 << 20
"""Of a zip's list of its files, which is read as a whole: an entry of 47 bytes takes hundreds."""


class _Archive(io.FileIO):
    """A zip from which nothing is read at once that is larger than a directory may be.

    `ZipFile` reads the directory in one piece, however many files it names, before they can be counted; files
    are read in smaller ones.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > MAX_DIRECTORY_BYTES:
            raise UploadTooLarge(
                f"The zip's list of files has {size >> 20} MiB; {MAX_FILES} files at most need less."
            )
        return super().read(-1 if size is None else size)


def unpack(packed: Path, folder: Path) -> None:
    """Unpack a zip: flat, bounded in number and size, no name twice."""
    try:
        with _Archive(packed) as stream, zipfile.ZipFile(stream) as archive:
            members = [m for m in archive.infolist() if not m.is_dir() and not _is_litter(m.filename)]
            _check_members(members)
            for member in members:
                with archive.open(member) as source:
                    copy(source, folder / safe_name(member.filename), member.file_size)
    except _DAMAGED as error:
        raise Invalid("The zip file is damaged or encrypted; please pack it again.") from error


def _is_litter(path: str) -> bool:
    return path.startswith("__MACOSX/") or PurePosixPath(path).name in (".DS_Store", "Thumbs.db")


def _check_members(members: list[zipfile.ZipInfo]) -> None:
    if len(members) > MAX_FILES:
        raise UploadTooLarge(f"The zip holds {len(members)} files; {MAX_FILES} is the most.")
    unpacked = sum(member.file_size for member in members)
    if unpacked > MAX_UNPACKED_BYTES:
        raise UploadTooLarge(
            f"The zip unpacks to {unpacked >> 20} MiB; {MAX_UNPACKED_BYTES >> 20} is the most."
        )
    for member in members:
        if member.file_size > MAX_RATIO * max(member.compress_size, 1024):
            raise Invalid(f"The zip's file '{member.filename[:100]}' unpacks to far more than a clip would.")
    names = [safe_name(member.filename) for member in members]
    if repeated := sorted(name for name, number in Counter(names).items() if number > 1):
        raise Invalid(f"The zip holds '{repeated[0]}' more than once; file names must differ.")
    check_names(names)
