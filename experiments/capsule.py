"""A capsule: one zip with a study's data, declaration, clips and report, each file identified by its hash."""

import csv
import hashlib
import io
import json
import lzma
import platform
import re
import shutil
import zipfile
import zlib
from collections import Counter
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from experiments.declaration.base import Declaration
from experiments.errors import InputError
from experiments.manifest import Sha256, file_sha256

# Software behind the results: versions of the interpreter, of the system and of every package in use.

PROGRAM = "palpebra"
_NAME = re.compile(r"^[A-Za-z0-9._-]+")


class Software(Declaration):
    """Versions of everything that a report depends on."""

    python: str
    """Version of Python."""
    system: str
    """Operating system and processor."""
    packages: dict[str, str]
    """Version of each installed package that the program needs, by its normalized name."""


def present_software() -> Software:
    """Software of the running process."""
    return Software(
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        packages=dict(sorted(_versions().items())),
    )


def _versions() -> dict[str, str]:
    """The program's packages and their dependencies, if they are installed; optional ones are omitted."""
    versions: dict[str, str] = {}
    waiting = [PROGRAM]
    while waiting:
        name = waiting.pop()
        if name in versions:
            continue
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:  # for another system
            continue
        versions[name] = distribution.version
        waiting.extend(
            _normalised(needed) for needed in distribution.requires or () if "extra ==" not in needed
        )
    return versions


def _normalised(requirement: str) -> str:
    matched = _NAME.match(requirement)
    return re.sub(r"[-_.]+", "-", matched[0]).lower() if matched else ""


def differences(before: Software, after: Software) -> list[str]:
    """All differences, one per line: `matplotlib 3.10.1 became 3.10.8`."""
    lines = [
        f"{name} {was} became {now}"
        for name, was, now in (
            ("Python", before.python, after.python),
            ("system", before.system, after.system),
        )
        if was != now
    ]
    for name in sorted({*before.packages, *after.packages}):
        was, now = before.packages.get(name, "(absent)"), after.packages.get(name, "(absent)")
        if was != now:
            lines.append(f"{name} {was} became {now}")
    return lines


# A zip that is opened without reading more at once than the maximum size of its file list.

MAX_DIRECTORY_BYTES = 8 << 20
"""Maximum size of a zip's file list, which is read at once: an entry of 47 bytes uses hundreds in memory."""


class ZipListError(InputError):
    """A zip lists more files than anything accepted here."""


class BoundedZip(io.FileIO):
    """The file of a zip, for `ZipFile`, which never reads more than the maximum file list at once.

    `ZipFile` reads the file list in one piece, however many files it names, before they can be counted. It
    reads files in smaller pieces.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        """Like any file; ZipListError if more is requested than the list may have."""
        if size is not None and size > MAX_DIRECTORY_BYTES:
            raise ZipListError(
                f"expected at most {MAX_DIRECTORY_BYTES >> 20} MiB for the file list of the zip, got "
                f"{size >> 20} MiB"
            )
        return super().read(-1 if size is None else size)


# `capsule.json`: the list of a capsule's files, and the sources of its report.
# A capsule is a study's data, declaration, clips and report in one zip. Each file is identified by its hash.
# The list reveals damage and mistakes. Someone who changes files on purpose can also write a new list, so
# print its own hash (`sha256`) in the paper.

CAPSULE_FILE = "capsule.json"
REPORT_FOLDER = "results"
MANIFEST = "materials/manifest.json"
"""Every clip with its hash."""
SOFTWARE_FILE = "documentation/software.json"
WRITTEN_BY_SERVER = ("methods.json", "methods.tex", "methods.txt")
"""Parts of the report folder made from the server's database; they are checked by hash only."""


class CapsuleFile(Declaration):
    """A file of the capsule."""

    path: Annotated[str, Field(min_length=1, max_length=400)]
    """Path from the root of the capsule, with slashes."""
    bytes: Annotated[int, Field(ge=0)]
    """Its length."""
    sha256: Sha256
    """SHA-256 of its bytes."""


class ReportSource(Declaration):
    """The sources of the report: the arguments of `analysis run`."""

    definition: str
    """Path of the declaration."""
    answers: str
    """Path of the table of answers."""
    runs: str
    """Path of the table of runs."""
    origin: Literal["participant", "pilot", "simulated"]
    """Origin of the answers."""
    series: Annotated[int, Field(ge=1)]
    """The data series."""
    sensitivity: bool
    """Whether the slow parts are included."""
    renamed: dict[str, str] = Field(default_factory=dict)
    """Factors with a different name in the table of answers, by their name in the declaration."""
    seal: str | None = None
    """Path of the sealed plan that the report is compared with; null if the plan was not sealed."""
    rebuilt: tuple[str, ...]
    """Files that regenerating the report produces."""


# Decision 0640: A capsule is a list of hashes and a report that can be regenerated.
class Capsule(Declaration):
    """`capsule.json`."""

    format: Literal[1] = 1
    """Format of this file."""
    study: str
    """Name of the study."""
    made: str
    """Day on which it was made (ISO 8601)."""
    report: ReportSource
    """The sources of the report."""
    software: Software
    """The software that made it."""
    files: Annotated[tuple[CapsuleFile, ...], Field(min_length=1)]
    """Every other file."""

    @property
    def sha256(self) -> str:
        """Hash over everything in this list: the identity of the capsule."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def text(self) -> str:
        """`capsule.json`, including its own hash."""
        data = self.model_dump(mode="json") | {"sha256": self.sha256}
        return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


# Make a capsule: list the files of a folder, and put them in a zip.

AT_ONCE = 2**20


def listed_files(folder: Path) -> tuple[CapsuleFile, ...]:
    """Every file of a folder except `capsule.json`, by path."""
    return tuple(
        CapsuleFile(path=path, bytes=(folder / path).stat().st_size, sha256=file_sha256(folder / path))
        for path in sorted(paths_in(folder))
        if path != CAPSULE_FILE
    )


def paths_in(folder: Path) -> list[str]:
    """Everything in a folder except folders, as relative paths."""
    return [path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()]


def pack(folder: Path, target: Path) -> None:
    """Write the zip of a capsule's folder: the same bytes for the same files."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(paths_in(folder)):
            member = zipfile.ZipInfo(path)  # its time is the earliest that a zip can have
            member.compress_type, member.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            with (folder / path).open("rb") as source, archive.open(member, "w", force_zip64=True) as stream:
                shutil.copyfileobj(source, stream, AT_ONCE)


def report_input(source: Path, target: Path, renamed: Mapping[str, str]) -> None:
    """Copy a table of answers with its factors renamed as in the declaration; everything else is
    unchanged."""
    own = {name: factor for factor, name in renamed.items()}
    with (
        source.open("r", encoding="utf-8", newline="") as table,
        target.open("w", encoding="utf-8", newline="") as copy,
    ):
        header = next(csv.reader([table.readline()]), [])
        csv.writer(copy, lineterminator="\n").writerow([own.get(name, name) for name in header])
        shutil.copyfileobj(table, copy, AT_ONCE)


# Open a capsule: every file is present, none is unlisted, and each hash matches the list.

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
"""Errors when a member of a damaged zip is read."""


class CapsuleError(InputError):
    """A capsule is invalid; the message begins with the file name."""


def open_capsule(capsule_path: Path, into: Path) -> tuple[Capsule, Path]:
    """Check a capsule, a zip or a folder; return its list and the folder of its files.

    Parameters
    ----------
    into : Path
        An empty folder, into which a zip is unpacked.

    Raises
    ------
    CapsuleError
        A file is missing, unlisted, or differs from its hash. The message starts with its path.
    InputError
        There is no capsule at this path.
    """
    if capsule_path.is_dir():
        capsule = _read_list(capsule_path / CAPSULE_FILE, capsule_path)
        _refuse_other_names(paths_in(capsule_path), capsule)
        for file in capsule.files:
            if (capsule_path / file.path).is_symlink():
                raise CapsuleError(f"{file.path}: expected a file, got a link; unpack the capsule again")
            _compare(file, (capsule_path / file.path).stat().st_size, file_sha256(capsule_path / file.path))
        return capsule, capsule_path
    if not capsule_path.is_file():
        raise InputError(f"{capsule_path}: expected a capsule (a zip, or its unpacked folder), found nothing")
    try:
        return _unpacked(capsule_path, into), into
    except CapsuleError:
        raise
    except (*_DAMAGED, RuntimeError, ZipListError) as error:
        raise CapsuleError(
            f"{capsule_path.name}: expected the zip of a capsule ({error}); download it again"
        ) from error


def _unpacked(capsule_path: Path, into: Path) -> Capsule:
    with BoundedZip(capsule_path) as stream, zipfile.ZipFile(stream) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        names = [member.filename for member in members]
        if repeated := [name for name, number in Counter(names).items() if number > 1]:
            raise CapsuleError(
                f"{repeated[0]}: occurs twice in {capsule_path.name}; download the capsule again"
            )
        if CAPSULE_FILE not in names:
            raise CapsuleError(
                f"{CAPSULE_FILE}: missing from {capsule_path.name}; this is not a capsule, or only a part "
                f"of one"
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
    """Write one member, no more bytes than the list allows, and compare its hash."""
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
        raise CapsuleError(f"{file.path}: the file was changed or damaged ({error})") from error
    _compare(file, size, digest.hexdigest())


def _read_list(path: Path, capsule_path: Path) -> Capsule:
    if not path.is_file():
        raise CapsuleError(
            f"{CAPSULE_FILE}: missing from {capsule_path.name}; this is not a capsule, or only a part of one"
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
        raise CapsuleError(f"{CAPSULE_FILE}: its content was changed: it does not match its own hash")
    for file in capsule.files:
        parts = PurePosixPath(file.path).parts
        if file.path.startswith("/") or ".." in parts or "\\" in file.path or file.path == CAPSULE_FILE:
            raise CapsuleError(f"{file.path[:100]!r}: expected a path inside the capsule")
    _refuse_sources_outside(capsule)
    return capsule


def _refuse_sources_outside(capsule: Capsule) -> None:
    """The sources for regenerating the report must be listed files, whose hashes were compared."""
    listed, report = {file.path for file in capsule.files}, capsule.report
    for path in (report.definition, report.answers, report.runs, report.seal):
        if path is not None and path not in listed:
            raise CapsuleError(
                f"{CAPSULE_FILE}: the report was made from {path[:100]!r}, which the list does not contain"
            )


def _refuse_more_than_fits(capsule: Capsule, into: Path) -> None:
    """Check the size before writing anything: a list can claim any size."""
    claimed, free = sum(file.bytes for file in capsule.files), shutil.disk_usage(into).free
    if claimed > free:
        raise CapsuleError(f"{CAPSULE_FILE}: its files take {claimed} bytes; {into} has {free} free")


def _refuse_other_names(names: list[str], capsule: Capsule) -> None:
    listed = {file.path for file in capsule.files} | {CAPSULE_FILE}
    if missing := sorted(listed - set(names)):
        raise CapsuleError(f"{missing[0]}: missing from the capsule{_more(missing)}; download it again")
    if foreign := sorted(set(names) - listed):
        raise CapsuleError(
            f"{foreign[0]}: not part of the capsule, because its list does not name it{_more(foreign)}; "
            f"remove it"
        )


def _more(names: list[str]) -> str:
    return f" (and {len(names) - 1} more)" if len(names) > 1 else ""


def _compare(file: CapsuleFile, size: int, sha256: str) -> None:
    if sha256 != file.sha256 or size != file.bytes:
        raise CapsuleError(
            f"{file.path}: the file was changed: expected sha256 {file.sha256[:12]}..., got {sha256[:12]}..."
        )
