"""What has been done with the videos of an upload: one line per file, written by the worker."""

from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationError

from experiments.files import whole_text
from experiments.manifest import MANIFEST_NAME
from video_conversion.prepared import VIDEO_ENDINGS, Prepared

RECORDS, FRAME_RATE, BEGUN, CLIPS = ".prepared", ".frame_rate", ".begun", ".clips"
_WHOSE = ".account"
"""File of an upload's folder with the number of the account that sent it."""


def mark(upload: Path, account: int) -> None:
    """Say whose an upload is."""
    (upload / _WHOSE).write_text(str(account), encoding="ascii")


def sender(upload: Path) -> str | None:
    """The number of the account that sent an upload; None where nobody is named."""
    # Uploads that an older release took have no sender; they end within a day.
    try:
        return (upload / _WHOSE).read_text(encoding="ascii")
    except (FileNotFoundError, NotADirectoryError):
        return None


def videos_of(folder: Path) -> list[Path]:
    """The videos of an upload that have come whole, by name."""
    return sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in VIDEO_ENDINGS and not path.name.startswith(".")
    )


def asked_rate(folder: Path) -> float | None:
    """Frames per second that an upload's clips are to have; None: each its own."""
    try:
        return float((folder / FRAME_RATE).read_text(encoding="ascii"))
    except (FileNotFoundError, ValueError):
        return None


def ask_rate(folder: Path, fps: float | None) -> None:
    """Ask for clips of `fps` frames per second, or for each at its own rate; clips are made again."""
    with whole_text(folder / FRAME_RATE) as stream:
        stream.write("" if fps is None else repr(fps))


def records_of(folder: Path) -> dict[str, Prepared]:
    """The clips prepared at the requested rate, by file name."""
    asked = asked_rate(folder)
    try:
        lines = (folder / RECORDS).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    records: dict[str, Prepared] = {}
    for record in filter(None, map(_record, lines)):
        if record.replaced:
            records.pop(record.name, None)
        elif record.asked_fps == asked:
            records[record.name] = record
    return records


def write_record(folder: Path, record: Prepared) -> None:
    """Add what is known of a file; the server and its worker only ever add lines."""
    with (folder / RECORDS).open("a", encoding="utf-8") as stream:
        stream.write(record.model_dump_json() + "\n")


def _record(line: str) -> Prepared | None:
    # The last line may be half written while it is read.
    try:
        return Prepared.model_validate_json(line)
    except ValidationError:
        return None


def waiting_in(folder: Path) -> list[Path]:
    """Videos of an upload that have not been looked into; those of a built set are taken as they are."""
    if (folder / MANIFEST_NAME).exists():
        return []
    done = records_of(folder)
    return [path for path in videos_of(folder) if path.name not in done]


def uploads_in(root: Path) -> Iterable[Path]:
    """Folders of uploads."""
    return sorted(path for path in root.iterdir() if path.is_dir()) if root.is_dir() else []
