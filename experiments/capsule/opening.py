"""Open a capsule: every file is there, none is foreign, each has the bytes that the list says."""

import hashlib
import json
import lzma
import shutil
import zipfile
import zlib
from collections import Counter
from pathlib import Path, PurePosixPath
from typing import Any

from pydantic import ValidationError

from experiments.bounded_zip import BoundedZip, ZipListError
from experiments.capsule.declaration import CAPSULE_FILE, Capsule, CapsuleFile
from experiments.capsule.packing import AT_ONCE, paths_in
from experiments.errors import InputError
from experiments.manifest import file_sha256

MAX_LIST_BYTES = 64 * 2**20
_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    ValueError,
    EOFError,
    OSError,
    NotImplementedError,
)
"""What reading a member of a spoilt zip raises."""


class CapsuleError(InputError):
    """A capsule is not what it says it is; the message begins with the file's name."""


def open_capsule(capsule_path: Path, into: Path) -> tuple[Capsule, Path]:
    """Check a capsule, a zip or a folder; return its list and the folder of its files.

    Parameters
    ----------
    into : Path
        An empty folder, into which a zip is unpacked.

    Raises
    ------
    CapsuleError
        A file is missing, foreign, or has other bytes than the list says: named by its path.
    InputError
        There is no capsule at this place.
    """
    if capsule_path.is_dir():
        capsule = _read_list(capsule_path / CAPSULE_FILE, capsule_path)
        _refuse_other_names(paths_in(capsule_path), capsule)
        for file in capsule.files:
            if (capsule_path / file.path).is_symlink():
                raise CapsuleError(f"{file.path}: expected a file, got a link; unpack the capsule anew")
            _compare(file, (capsule_path / file.path).stat().st_size, file_sha256(capsule_path / file.path))
        return capsule, capsule_path
    if not capsule_path.is_file():
        raise InputError(
            f"{capsule_path}: expected a capsule (a zip, or the folder of one), found nothing there"
        )
    try:
        return _unpacked(capsule_path, into), into
    except CapsuleError:
        raise
    except (*_DAMAGED, RuntimeError, ZipListError) as error:
        raise CapsuleError(
            f"{capsule_path.name}: expected the zip of a capsule ({error}); download it anew"
        ) from error


def _unpacked(capsule_path: Path, into: Path) -> Capsule:
    with BoundedZip(capsule_path) as stream, zipfile.ZipFile(stream) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        names = [member.filename for member in members]
        if repeated := [name for name, number in Counter(names).items() if number > 1]:
            raise CapsuleError(
                f"{repeated[0]}: stands twice in {capsule_path.name}; download the capsule anew"
            )
        if CAPSULE_FILE not in names:
            raise CapsuleError(
                f"{CAPSULE_FILE}: missing from {capsule_path.name}; it is no capsule, or a part of one"
            )
        head = archive.getinfo(CAPSULE_FILE)
        if head.file_size > MAX_LIST_BYTES:
            raise CapsuleError(
                f"{CAPSULE_FILE}: {head.file_size:,} bytes, expected at most {MAX_LIST_BYTES:,}"
            )
        (into / CAPSULE_FILE).write_bytes(archive.read(head))
        capsule = _read_list(into / CAPSULE_FILE, capsule_path)
        _refuse_other_names(names, capsule)
        _refuse_more_than_fits(capsule, into)
        for file in capsule.files:
            _unpack_one(archive, file, into)
    return capsule


def _unpack_one(archive: zipfile.ZipFile, file: CapsuleFile, into: Path) -> None:
    """Write one member, no more bytes than the list says, and compare its hash."""
    target = into / file.path
    target.parent.mkdir(parents=True, exist_ok=True)
    digest, size = hashlib.sha256(), 0
    try:
        with archive.open(file.path) as source, target.open("wb") as stream:
            while size <= file.bytes and (piece := source.read(AT_ONCE)):
                stream.write(piece)
                digest.update(piece)
                size += len(piece)
    except _DAMAGED as error:
        raise CapsuleError(f"{file.path}: its bytes were changed or damaged ({error})") from error
    _compare(file, size, digest.hexdigest())


def _read_list(path: Path, capsule_path: Path) -> Capsule:
    if not path.is_file():
        raise CapsuleError(
            f"{CAPSULE_FILE}: missing from {capsule_path.name}; it is no capsule, or a part of one"
        )
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        own = data.pop("sha256", None)
        capsule = Capsule.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise CapsuleError(f"{CAPSULE_FILE}: {where}: {first['msg']}; it was changed or damaged") from error
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        raise CapsuleError(f"{CAPSULE_FILE}: not the JSON of a capsule ({error})") from error
    if own != capsule.sha256:
        raise CapsuleError(f"{CAPSULE_FILE}: its content was changed: it has another hash than it says")
    for file in capsule.files:
        parts = PurePosixPath(file.path).parts
        if file.path.startswith("/") or ".." in parts or "\\" in file.path or file.path == CAPSULE_FILE:
            raise CapsuleError(f"{file.path[:100]!r}: no path inside a capsule")
    _refuse_sources_outside(capsule)
    return capsule


def _refuse_sources_outside(capsule: Capsule) -> None:
    """What the report is made again from must be files of the list, whose hashes were compared."""
    listed, report = {file.path for file in capsule.files}, capsule.report
    for path in (report.definition, report.answers, report.runs, report.seal):
        if path is not None and path not in listed:
            raise CapsuleError(f"{CAPSULE_FILE}: the report was made of {path[:100]!r}, no file of the list")


def _refuse_more_than_fits(capsule: Capsule, into: Path) -> None:
    """Before anything is written: a list may claim any size."""
    claimed, free = sum(file.bytes for file in capsule.files), shutil.disk_usage(into).free
    if claimed > free:
        raise CapsuleError(f"{CAPSULE_FILE}: its files take {claimed} bytes; {into} has {free} free")


def _refuse_other_names(names: list[str], capsule: Capsule) -> None:
    listed = {file.path for file in capsule.files} | {CAPSULE_FILE}
    if missing := sorted(listed - set(names)):
        raise CapsuleError(f"{missing[0]}: missing from the capsule{_more(missing)}; download it anew")
    if foreign := sorted(set(names) - listed):
        raise CapsuleError(
            f"{foreign[0]}: foreign to the capsule, its list does not name it{_more(foreign)}; remove it"
        )


def _more(names: list[str]) -> str:
    return f" (and {len(names) - 1} more)" if len(names) > 1 else ""


def _compare(file: CapsuleFile, size: int, sha256: str) -> None:
    if sha256 != file.sha256 or size != file.bytes:
        raise CapsuleError(
            f"{file.path}: its bytes were changed: expected sha256 {file.sha256[:12]}..., "
            f"got {sha256[:12]}..."
        )
