"""Backups of released revisions, kept compressed: a clone has thirty of them."""

import gzip
from pathlib import Path

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "backups"
SUFFIX = ".tar.gz"
REVISIONS = sorted(file.name.removesuffix(SUFFIX) for file in GOLDEN.glob(f"*{SUFFIX}"))


def golden_backup(revision: str, folder: Path) -> Path:
    """Unpack a revision's backup into a folder and return it, as `server backup` had written it."""
    file = folder / f"{revision}.tar"
    file.write_bytes(gzip.decompress((GOLDEN / f"{revision}{SUFFIX}").read_bytes()))
    return file


def golden_keys(revision: str) -> Path | None:
    """Key file of a revision's backup; None of those from before there were keys."""
    file = GOLDEN / f"{revision}.keys.json"
    return file if file.exists() else None


def keep_backup(file: Path) -> None:
    """Put a backup that `server backup` wrote, named by its revision, among the golden ones."""
    # Without a time in it the same backup gives the same bytes.
    (GOLDEN / f"{file.stem}{SUFFIX}").write_bytes(gzip.compress(file.read_bytes(), 9, mtime=0))
