"""Uploads of own clips: streamed to a folder of their own, unpacked with limits, probed."""

import re
import secrets
import shutil
import time
import zipfile
from pathlib import Path, PurePosixPath
from typing import IO

from experiments.files import whole_file
from experiments.manifest import MANIFEST_NAME, file_sha256
from experiments.own_clips import check_names, one_form, suggest_pattern
from server.errors import ApiError, Invalid, NotFound
from server.studies.probe import NotAFilm, probe
from server.studies.schemas import UploadedFile, UploadOut

KEEP_S = 24 * 3600
MAX_FILES = 5000
MAX_UNPACKED_BYTES = 4 * 1024**3
MAX_RATIO = 200
FILMS = (".mp4", ".m4v", ".mov", ".webm")
TABLES = (".csv", ".json")
CHUNK_BYTES = 1 << 20
_WHOSE = ".account"
"""File of an upload's folder with the number of the account that sent it."""
NAME = re.compile(r"\w[^\x00-\x1f\x7f]*")


class UploadTooLarge(ApiError):
    """The upload is larger than this server takes."""

    status = 413
    code = "too_large"


def new_upload(folder: Path, account: int) -> tuple[str, Path]:
    """Make the folder of an account's new upload, and remove uploads older than a day."""
    _sweep(folder)
    identifier = secrets.token_hex(16)
    place = folder / identifier
    place.mkdir(parents=True, mode=0o700)
    (place / _WHOSE).write_text(str(account), encoding="ascii")
    return identifier, place


def _sweep(folder: Path) -> None:
    for old in folder.iterdir() if folder.is_dir() else ():
        if time.time() - old.stat().st_mtime > KEEP_S:
            shutil.rmtree(old, ignore_errors=True)


def discard(place: Path) -> None:
    """Remove an upload that was refused."""
    shutil.rmtree(place, ignore_errors=True)


def upload_folder(folder: Path, identifier: str, account: int) -> Path:
    """The folder of an account's upload; NotFound where there is none (identifiers are hexadecimal)."""
    place = folder / identifier
    known = len(identifier) == 32 and set(identifier) <= set("0123456789abcdef") and place.is_dir()
    if not known or _sender(place) != str(account):
        raise NotFound("There is no such upload, or it is older than a day; please upload the clips again.")
    return place


def _sender(place: Path) -> str | None:
    # Uploads that an older release took have no sender; they end within a day.
    try:
        return (place / _WHOSE).read_text(encoding="ascii")
    except FileNotFoundError:
        return None


def receive(place: Path, name: str, source: IO[bytes], limit: int) -> None:
    """Store one uploaded file, or unpack it where it is a zip; nothing is kept of a refused one."""
    if name.lower().endswith(".zip"):
        packed = place / ".zip"
        try:
            _copy(source, packed, limit)
            unpack(packed, place)
        finally:
            packed.unlink(missing_ok=True)
    else:
        target = place / safe_name(name)
        if target.exists():
            raise Invalid(f"'{target.name}' came more than once; file names must differ.")
        _copy(source, target, limit)


def safe_name(path: str) -> str:
    """The file's own name; Invalid where the path climbs out or is not a film or table."""
    pure = PurePosixPath(path.replace("\\", "/"))
    if pure.is_absolute() or ".." in pure.parts or not pure.name or pure.name.startswith("."):
        raise Invalid(f"The file '{path[:100]}' has a path that is not allowed; expected plain file names.")
    if pure.suffix.lower() not in FILMS + TABLES:
        raise Invalid(f"The file '{pure.name[:100]}' is neither a film ({', '.join(FILMS)}) nor a CSV table.")
    if len(pure.name) > 150:
        raise Invalid(f"The file name '{pure.name[:100]}...' is too long; 150 characters are the most.")
    name = one_form(pure.name)
    if not NAME.fullmatch(name):
        raise Invalid(f"The file name '{name[:100]}' should begin with a letter or digit; rename the file.")
    return name


def unpack(packed: Path, place: Path) -> None:
    """Unpack a zip: flat, bounded in number and size, no name twice."""
    try:
        with zipfile.ZipFile(packed) as archive:
            members = [m for m in archive.infolist() if not m.is_dir() and not _is_litter(m.filename)]
            _check_members(members)
            for member in members:
                with archive.open(member) as source:
                    _copy(source, place / safe_name(member.filename), member.file_size)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
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
            raise Invalid(f"The zip's file '{member.filename[:100]}' unpacks to far more than a film would.")
    names = [safe_name(member.filename) for member in members]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise Invalid(f"The zip holds '{repeated[0]}' more than once; file names must differ.")
    check_names(names)


def _copy(source: IO[bytes], target: Path, limit: int) -> None:
    written = 0
    with whole_file(target) as temporary, temporary.open("wb") as stream:
        while piece := source.read(CHUNK_BYTES):
            written += len(piece)
            if written > limit:
                raise UploadTooLarge(f"'{target.name}' is larger than the {limit >> 20} MiB accepted.")
            stream.write(piece)


def describe(identifier: str, place: Path) -> UploadOut:
    """Probe every film of an upload."""
    paths = sorted(path for path in place.iterdir() if path.is_file() and not path.name.startswith("."))
    films = [path for path in paths if path.suffix.lower() in FILMS]
    check_names(path.name for path in films)
    return UploadOut(
        id=identifier,
        files=[_described(path) for path in films],
        has_manifest=any(path.name == MANIFEST_NAME for path in paths),
        tables=[path.name for path in paths if path.suffix.lower() == ".csv"],
        suggested_pattern=suggest_pattern([path.name for path in films]),
    )


def _described(path: Path) -> UploadedFile:
    shared = {"name": path.name, "bytes": path.stat().st_size, "sha256": file_sha256(path)}
    try:
        film = probe(path)
    except NotAFilm as error:
        return UploadedFile.model_validate(shared | {"problem": str(error)})
    return UploadedFile.model_validate(shared | vars(film))
