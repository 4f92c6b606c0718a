"""Uploads of own clips: streamed to a folder of their own, unpacked with limits, and what became of them."""

import secrets
import shutil
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from experiments.manifest import MANIFEST_NAME
from experiments.own_clips import check_names, one_form, suggest_pattern
from server.errors import Invalid, NotFound
from server.studies.clip_schemas import UploadedFile, UploadOut, UploadProgress
from server.studies.left_out import files_aside
from server.studies.packed import MAX_FILES, unpack
from server.studies.upload_quota import Quota
from server.studies.uploaded_file import UploadTooLarge, copy, safe_name
from server.transcoding.records import (
    ask_rate,
    asked_rate,
    mark,
    records_of,
    sender,
    videos_of,
    write_record,
)
from video_conversion.prepared import Prepared, clip_name

KEEP_S = 24 * 3600
MAX_KEPT_BYTES = 16 * 1024**3
"""Of all files of one upload."""


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
        raise NotFound("There is no such upload, or it is older than a day; please upload the clips again.")
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
            raise Invalid(f"'{target.name}' came more than once; file names must differ.")
        copy(source, target, limit, within=quota)


def check_room(folder: Path) -> None:
    """UploadTooLarge where an upload holds as much as one may."""
    # Files that begin with a dot are the worker's, and may go at any moment.
    kept = [path for path in folder.iterdir() if not path.name.startswith(".")]
    kept += files_aside(folder)
    if len(kept) > MAX_FILES or sum(map(_size, kept)) > MAX_KEPT_BYTES:
        raise UploadTooLarge(
            f"An upload holds at most {MAX_FILES} files and {MAX_KEPT_BYTES >> 30} GiB; add the others "
            "to the study as a new version."
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
        The new file is larger than this server takes, or than the account has room for beside the old one.
    """
    target, asked = folder / safe_name(name), one_form(old)
    # Looked up among the names that there are: nothing else that is sent becomes a path.
    known = next((path for path in videos_of(folder) if path.name == asked), None)
    if known is None:
        raise NotFound(f"This upload has no file '{old[:100]}' to replace.")
    if not (folder / MANIFEST_NAME).exists() and known.name not in records_of(folder):
        raise Invalid(f"'{known.name}' is still being looked into; replace it once it has been.")
    if target != known and target.exists():
        raise Invalid(f"'{target.name}' has come already; file names must differ.")
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
    files = [_described(path, records.get(path.name), first_of, built=has_manifest) for path in clips]
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


def _described(path: Path, record: Prepared | None, first_of: dict[str, str], *, built: bool) -> UploadedFile:
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
