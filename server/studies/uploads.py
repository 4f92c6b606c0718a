"""Uploads of own clips: streamed to a separate folder, unpacked with limits, and what became of them."""

import lzma
import os
import re
import secrets
import shutil
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import IO, Protocol
from urllib.parse import quote

from sqlalchemy.orm import Session

from experiments.capsule import BoundedZip, ZipListError
from experiments.files import whole_file
from experiments.manifest import MANIFEST_NAME, Manifest, SourceVideo
from experiments.own_clips import check_names, one_form, suggest_pattern
from server.accounts.identity import Identity
from server.core.errors import ApiError, Invalid, NotFound
from server.studies.lookup import find_study
from server.studies.schemas import UploadedFile, UploadOut, UploadProgress
from server.transcoding.records import (
    ask_rate,
    asked_rate,
    mark,
    records_of,
    sender,
    videos_of,
    write_record,
)
from video_conversion.prepared import VIDEO_ENDINGS, Prepared, clip_name

# One file that is uploaded: a name that leads nowhere else, and bytes up to a limit.

TABLES = (".csv", ".json")
CHUNK_BYTES = 1 << 20
NAME = re.compile(r"\w[^\x00-\x1f\x7f]*")


class UploadTooLarge(ApiError, status=413, code="too_large"):
    """The upload is larger than this server takes."""


def safe_name(path: str) -> str:
    """The file's own name; Invalid where the path climbs out or is not a clip or table."""
    pure = PurePosixPath(path.replace("\\", "/"))
    if pure.is_absolute() or ".." in pure.parts or not pure.name or pure.name.startswith("."):
        raise Invalid(f"The file '{path[:100]}' has an invalid path; expected plain file names.")
    if pure.suffix.lower() not in VIDEO_ENDINGS + TABLES:
        raise Invalid(
            f"The file '{pure.name[:100]}' is neither a video ({', '.join(VIDEO_ENDINGS)}) nor a CSV table."
        )
    if len(pure.name) > 150:
        raise Invalid(f"The file name '{pure.name[:100]}...' is too long; the maximum is 150 characters.")
    name = one_form(pure.name)
    if not NAME.fullmatch(name):
        raise Invalid(f"The file name '{name[:100]}' must begin with a letter or digit. Rename the file.")
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
                    f"'{called or target.name}' is larger than the maximum of {limit >> 20} MiB."
                )
            if within is not None and room is not None and written > room:
                raise within.full()
            stream.write(piece)
        if within is not None:
            stream.flush()
            within.check()


# What the uploads of one account may hold together; each is removed after a day.

MAX_UPLOADS = 200
"""Per account within a day."""


@dataclass(frozen=True)
class Quota:
    """The room of one account.

    It is looked at before bytes come and again once they are on the disk, before they get their name: of
    several that come at once, by whatever worker, the last to look sees the others.

    Attributes
    ----------
    folder : Path
        Of every account's uploads.
    account : int
        Its number.
    bytes : int
        That its uploads may hold together.
    """

    folder: Path
    account: int
    bytes: int

    def check(self, further: int = 0) -> None:
        """UploadTooLarge where the account holds more than it may, or `further` uploads were too many."""
        self._room(further)

    def room(self) -> int:
        """Bytes that may come still; UploadTooLarge where there are none."""
        left = self._room(0)
        if not left:
            raise self._full(self._held())
        return left

    def full(self) -> UploadTooLarge:
        """What is said where more comes than there is room for."""
        return self._full(self._held())

    def _room(self, further: int) -> int:
        held = self._held()
        if held > self.bytes or (further and len(self._own()) + further > MAX_UPLOADS):
            raise self._full(held)
        return self.bytes - held

    def _own(self) -> list[Path]:
        folders = self.folder.iterdir() if self.folder.is_dir() else ()
        return [one for one in folders if sender(one) == str(self.account)]

    def _held(self) -> int:
        # What is made from the files, and what is set aside, takes room, too.
        return sum(size for one in self._own() for size in _sizes(one))

    def _full(self, held: int) -> UploadTooLarge:
        return UploadTooLarge(
            f"Your uploads of the last day contain {held / 1e9:.1f} GB in {len(self._own())} folders; at "
            f"most "
            f"{self.bytes / 1e9:.1f} GB in {MAX_UPLOADS} are kept. "
            "Each upload is removed after a day; studies made from it stay."
        )


def _sizes(upload: Path) -> Iterator[int]:
    # Files and folders may go at any moment: the worker's own, and those that become a study.
    try:
        with os.scandir(upload) as entries:
            for entry in entries:
                yield from (
                    _sizes(Path(entry.path)) if entry.is_dir(follow_symlinks=False) else _folder_size(entry)
                )
    except (FileNotFoundError, NotADirectoryError):
        return


def _folder_size(entry: os.DirEntry[str]) -> Iterator[int]:
    with suppress(FileNotFoundError):
        yield entry.stat(follow_symlinks=False).st_size


# Zips of own clips: unpacked flat, bounded in number, in size and in what their directory takes.

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
        raise Invalid("The zip file is damaged or encrypted. Please create it again.") from error


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
        raise UploadTooLarge(f"The zip holds {len(members)} files; the maximum is {MAX_FILES}.")
    unpacked = sum(member.file_size for member in members)
    if unpacked > MAX_UNPACKED_BYTES:
        raise UploadTooLarge(
            f"The zip unpacks to {unpacked >> 20} MiB; the maximum is {MAX_UNPACKED_BYTES >> 20} MiB."
        )
    for member in members:
        if member.file_size > MAX_RATIO * max(member.compress_size, 1024):
            raise Invalid(
                f"The zip's file '{member.filename[:100]}' unpacks to far more than a clip can have."
            )
    names = [safe_name(member.filename) for member in members]
    if repeated := sorted(name for name, number in Counter(names).items() if number > 1):
        raise Invalid(f"The zip holds '{repeated[0]}' more than once; file names must differ.")
    check_names(names)


# Files of an upload that are left out of the study to be made: set aside, and put back when asked for.

ASIDE = ".left_out"
"""Folder in an upload's folder; its content is not a file of the upload, and is removed with it."""


def files_aside(folder: Path) -> list[Path]:
    """The files that an upload leaves out, by name."""
    aside = folder / ASIDE
    return videos_of(aside) if aside.is_dir() else []


def leave_out(folder: Path, name: str) -> None:
    """Set one file aside; one that is left out already stays so.

    What is known of it goes along: another file of its name is looked into as any other.

    Raises
    ------
    NotFound
        The upload has no such file.
    Invalid
        It is still being looked into, or belongs to a built set, which is taken as a whole.
    """
    file, aside = _file_called(videos_of(folder), name), folder / ASIDE
    if file is None:
        if _file_called(files_aside(folder), name) is None:
            raise NotFound(f"This upload has no file '{name[:100]}'.")
        return
    if (folder / MANIFEST_NAME).exists():
        raise Invalid(
            "The clips of a built set can only be used together. Exclude clips in its definition instead."
        )
    record = records_of(folder).get(file.name)
    if record is None:
        raise Invalid(f"'{file.name}' is still being checked. You can remove it afterwards.")
    aside.mkdir(mode=0o700, exist_ok=True)
    write_record(aside, record)
    write_record(folder, Prepared(name=file.name, asked_fps=None, replaced=True))
    file.replace(aside / file.name)


def put_back(folder: Path, name: str) -> None:
    """Take a file in again that was left out; one that is there already stays.

    It is looked into again only where another frame rate was asked for, before or since.

    Raises
    ------
    NotFound
        The upload has no such file.
    Invalid
        Another file of its name, or one that would be the same clip, has come since.
    """
    file, there = _file_called(files_aside(folder), name), videos_of(folder)
    if file is None:
        if _file_called(there, name) is None:
            raise NotFound(f"This upload has no file '{name[:100]}'.")
        return
    target = folder / file.name
    if target.exists():
        raise Invalid(f"Another '{file.name}' was uploaded since. Remove that file first.")
    check_names(clip_name(path.name) for path in (*there, file))
    record = records_of(file.parent).get(file.name)
    file.replace(target)
    if record is not None:
        write_record(folder, record)


def _file_called(files: list[Path], name: str) -> Path | None:
    # Looked up among the names that there are: nothing that is sent becomes a path.
    asked = one_form(name)
    return next((path for path in files if path.name == asked), None)


KEEP_S = 24 * 3600
MAX_KEPT_BYTES = 16 * 1024**3
"""For all files of one upload together."""


def new_upload(quota: Quota, fps: float | None = None) -> tuple[str, Path]:
    """Make the folder of an account's new upload, and remove uploads older than a day.

    Raises
    ------
    UploadTooLarge
        The account's uploads hold as much as they may already, or are too many.
    """
    folder = quota.folder
    _sweep(folder)
    quota.check(further=1)
    identifier = secrets.token_hex(16)
    upload = folder / identifier
    upload.mkdir(parents=True, mode=0o700)
    mark(upload, quota.account)
    ask_rate(upload, fps)
    return identifier, upload


def _sweep(folder: Path) -> None:
    for old in folder.iterdir() if folder.is_dir() else ():
        with suppress(FileNotFoundError):  # another worker sweeps too
            if time.time() - old.stat().st_mtime > KEEP_S:
                shutil.rmtree(old, ignore_errors=True)


def discard(folder: Path) -> None:
    """Remove an upload that was refused."""
    shutil.rmtree(folder, ignore_errors=True)


def upload_folder(folder: Path, identifier: str, account: int) -> Path:
    """The folder of an account's upload; NotFound where there is none (identifiers are hexadecimal)."""
    upload = folder / identifier
    known = len(identifier) == 32 and set(identifier) <= set("0123456789abcdef") and upload.is_dir()
    if not known or sender(upload) != str(account):
        raise NotFound("There is no such upload, or it is older than a day. Please upload the clips again.")
    return upload


def receive(folder: Path, name: str, source: IO[bytes], limit: int, quota: Quota) -> None:
    """Store one uploaded file, or unpack it where it is a zip; nothing is kept of a refused one."""
    if name.lower().endswith(".zip"):
        packed = folder / ".zip"
        try:
            copy(source, packed, limit, within=quota)
            unpack(packed, folder, quota)
        finally:
            packed.unlink(missing_ok=True)
    else:
        target = folder / safe_name(name)
        if target.exists():
            raise Invalid(f"'{target.name}' was uploaded more than once; file names must differ.")
        copy(source, target, limit, within=quota)


def check_room(folder: Path) -> None:
    """UploadTooLarge where an upload holds as much as one may."""
    # Files that begin with a dot are the worker's, and may go at any moment.
    kept = [path for path in folder.iterdir() if not path.name.startswith(".")]
    kept += files_aside(folder)
    if len(kept) > MAX_FILES or sum(map(_size, kept)) > MAX_KEPT_BYTES:
        raise UploadTooLarge(
            f"An upload holds at most {MAX_FILES} files and {MAX_KEPT_BYTES >> 30} GiB. Add the others to "
            f"the study as a new version."
        )


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:  # replaced or left out meanwhile
        return 0


def receive_more(folder: Path, name: str, source: IO[bytes], limit: int, quota: Quota) -> None:
    """Store one more file of an upload that goes on; one that has come already is passed over.

    Raises
    ------
    Invalid
        Another file of this name has come.
    UploadTooLarge
        The file is larger than this server takes, or than the account has room for.
    """
    target = folder / safe_name(name)
    if target.exists() and target.stat().st_size == _length(source):
        return
    receive(folder, name, source, limit, quota)


def replace(folder: Path, old: str, name: str, source: IO[bytes], limit: int, quota: Quota) -> None:
    """Put another file in the place of one that has been looked into, such as one that was refused.

    The new file is whole before the old one goes, and is looked into as any other.

    Raises
    ------
    NotFound
        The upload has no such file.
    Invalid
        It is still being looked into, or the new file's name is that of a third.
    UploadTooLarge
        The new file is larger than this server takes, or than the account has room for in addition to the old
        one.
    """
    target, asked = folder / safe_name(name), one_form(old)
    # Looked up among the names that there are: nothing else that is sent becomes a path.
    known = next((path for path in videos_of(folder) if path.name == asked), None)
    if known is None:
        raise NotFound(f"This upload has no file '{old[:100]}' to replace.")
    if not (folder / MANIFEST_NAME).exists() and known.name not in records_of(folder):
        raise Invalid(f"'{known.name}' is still being checked. You can replace it afterwards.")
    if target != known and target.exists():
        raise Invalid(f"'{target.name}' was already uploaded; file names must differ.")
    others = [path.name for path in videos_of(folder) if path not in (known, target)]
    check_names(clip_name(one) for one in (*others, target.name))
    staged = folder / f".{secrets.token_hex(8)}{target.suffix}"
    try:
        copy(source, staged, limit, target.name, quota)
        known.unlink()
        write_record(folder, Prepared(name=known.name, asked_fps=None, replaced=True))
        staged.replace(target)
    finally:
        staged.unlink(missing_ok=True)


def _length(source: IO[bytes]) -> int:
    length = source.seek(0, 2)
    source.seek(0)
    return length


def describe(identifier: str, folder: Path) -> UploadOut:
    """Every video of an upload, and what became of those that have been looked into."""
    paths = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    clips, records = videos_of(folder), records_of(folder)
    has_manifest = any(path.name == MANIFEST_NAME for path in paths)
    check_names(clip_name(path.name) for path in clips)
    first_of: dict[str, str] = {}
    files = [_described_file(path, records.get(path.name), first_of, built=has_manifest) for path in clips]
    return UploadOut(
        id=identifier,
        files=files,
        waiting=sum(file.state == "waiting" for file in files),
        fps=asked_rate(folder),
        has_manifest=has_manifest,
        left_out=[path.name for path in files_aside(folder)],
        tables=[path.name for path in paths if path.suffix.lower() == ".csv"],
        suggested_pattern=suggest_pattern([path.name for path in clips]),
    )


def _described_file(
    path: Path, record: Prepared | None, first_of: dict[str, str], *, built: bool
) -> UploadedFile:
    shared = {"name": path.name, "bytes": path.stat().st_size}
    if record is None:
        return UploadedFile.model_validate(shared | {"state": "ready" if built else "waiting"})
    if record.problem is not None:
        return UploadedFile.model_validate(shared | {"state": "refused", "problem": record.problem})
    first = first_of.setdefault(record.sha256, path.name)
    about = {name: getattr(record, name) for name in ("sha256", "fps", "frames", "width_px", "height_px")}
    source = record.source and record.source.model_copy(update={"frame_map": ()})
    same_as = first if first != path.name else None
    return UploadedFile.model_validate(
        shared | about | {"state": "ready", "same_as": same_as, "source": source}
    )


def find_clip(folder: Path, sha256: str) -> Path:
    """The file of an upload's clip, as participants would get it; NotFound where none has this hash."""
    # Looked up among the clips that there are: nothing that is sent becomes a path.
    clips = (folder / record.clip for record in records_of(folder).values() if record.sha256 == sha256)
    clip = next((path for path in clips if path.is_file()), None) if sha256 else None
    if clip is None:
        raise NotFound("This upload has no such clip.")
    return clip


def progress(folder: Path) -> UploadProgress:
    """How far an upload's videos have been looked into and converted."""
    clips, records = videos_of(folder), records_of(folder)
    known = [records[path.name] for path in clips if path.name in records]
    waiting = 0 if (folder / MANIFEST_NAME).exists() else len(clips) - len(known)
    return UploadProgress(
        files=len(clips),
        waiting=waiting,
        refused=sum(record.problem is not None for record in known),
        left_out=len(files_aside(folder)),
    )


# Originals of converted clips: kept with the study as they were sent.


def find_source(session: Session, study: str, sha256: str, identity: Identity) -> SourceVideo:
    """What is known of an original, by its hash; NotFound where no version of the study has it."""
    for version in reversed(find_study(session, study, identity, "view").versions):
        for clip in Manifest.model_validate(version.manifest).clips:
            if clip.source is not None and clip.source.sha256 == sha256:
                return clip.source
    raise NotFound(
        "No clip of this study was made from such a file; reload the page to get the current list."
    )


def content_disposition(name: str) -> str:
    """The header by which a browser saves a file under its own name, in any script."""
    return f"attachment; filename*=UTF-8''{quote(name, safe='')}"
