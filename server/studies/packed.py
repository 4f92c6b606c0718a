"""Zips of own clips: unpacked flat, bounded in number, in size and in what their directory takes."""

import lzma
import zipfile
import zlib
from collections import Counter
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from experiments.bounded_zip import BoundedZip, ZipListError
from experiments.own_clips import check_names
from server.errors import Invalid
from server.studies.uploaded_file import Room, UploadTooLarge, copy, safe_name

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


def unpack(packed: Path, folder: Path, within: Room | None = None) -> None:
    """Unpack a zip: flat, bounded in number and size, no name twice; all of its files come or none."""
    try:
        with BoundedZip(packed) as stream, zipfile.ZipFile(stream) as archive:
            members = [m for m in archive.infolist() if not m.is_dir() and not _is_litter(m.filename)]
            _check_members(members)
            if within is not None and sum(member.file_size for member in members) > within.room():
                raise within.full()
            _take_out(archive, members, folder, within)
    except ZipListError as error:
        raise UploadTooLarge(f"Nothing was unpacked: {error}; {MAX_FILES} files need less.") from error
    except _DAMAGED as error:
        raise Invalid("The zip file is damaged or encrypted; please pack it again.") from error


def _take_out(
    archive: zipfile.ZipFile, members: list[zipfile.ZipInfo], folder: Path, within: Room | None
) -> None:
    with TemporaryDirectory(dir=folder, prefix=".unpacked-") as name:
        for member in members:
            with archive.open(member) as source:
                copy(source, Path(name) / safe_name(member.filename), member.file_size)
        if within is not None:
            within.check()
        for path in Path(name).iterdir():
            path.replace(folder / path.name)


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
