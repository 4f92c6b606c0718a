"""Make a capsule: list the files of a folder, and put them into a zip."""

import csv
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path

from experiments.capsule.declaration import CAPSULE_FILE, CapsuleFile
from experiments.manifest import file_sha256

AT_ONCE = 2**20


def listed_files(folder: Path) -> tuple[CapsuleFile, ...]:
    """Every file of a folder but `capsule.json`, by path."""
    return tuple(
        CapsuleFile(path=path, bytes=(folder / path).stat().st_size, sha256=file_sha256(folder / path))
        for path in sorted(paths_in(folder))
        if path != CAPSULE_FILE
    )


def paths_in(folder: Path) -> list[str]:
    """Every file of a folder, and whatever else is no folder, as paths from it."""
    return [path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()]


def pack(folder: Path, target: Path) -> None:
    """Write the zip of a capsule's folder: the same bytes for the same files."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(paths_in(folder)):
            member = zipfile.ZipInfo(path)  # its time is the first that a zip can have
            member.compress_type, member.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            with (folder / path).open("rb") as source, archive.open(member, "w", force_zip64=True) as stream:
                shutil.copyfileobj(source, stream, AT_ONCE)


def report_input(source: Path, target: Path, renamed: Mapping[str, str]) -> None:
    """Copy a table of answers, its factors called as the declaration calls them; all else stays as it is."""
    own = {name: factor for factor, name in renamed.items()}
    with (
        source.open("r", encoding="utf-8", newline="") as table,
        target.open("w", encoding="utf-8", newline="") as copy,
    ):
        header = next(csv.reader([table.readline()]), [])
        csv.writer(copy, lineterminator="\n").writerow([own.get(name, name) for name in header])
        shutil.copyfileobj(table, copy, AT_ONCE)
