"""The ledger of erasures: a file next to the database and outside its backups, replayed at every restore.

It names runs by their public ids, which say nothing of a person.
"""

import json
import logging
import os
from contextlib import suppress
from pathlib import Path
from typing import IO

from experiments.files import whole_private_file
from server.core.settings import Settings
from server.core.values import iso, now

LOG = logging.getLogger(__name__)
LEDGER_NAME = "erasures.ndjson"
KNOWN_FROM, KNOWN_UNTIL = "known_from", "known_until"


# Decision 0541: A ledger of erasures outside the backups.
def ledger_path(settings: Settings) -> Path:
    """The file; it may be missing where nobody was erased yet."""
    return settings.common_folder / LEDGER_NAME


def note_erased(settings: Settings, runs: list[str]) -> None:
    """Write down that these runs (public ids) are erased; on disk when this returns."""
    _append(settings, "run", runs)


def note_identifiers_erased(settings: Settings, runs: list[str]) -> None:
    """Write down that it is erased who these runs' persons are; their answers stay."""
    _append(settings, "identifiers_of", runs)


def begin_ledger(settings: Settings) -> None:
    """Make a ledger where there is none, which knows of erasures from now on: an older one may be lost."""
    path = ledger_path(settings)
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as stream:
            stream.write(json.dumps({KNOWN_FROM: iso(now())}).encode() + b"\n")


def known_from(ledger_lines: bytes) -> str:
    """The first moment from which a ledger knows who was erased; empty where it was there from the start."""
    return _latest(ledger_lines, KNOWN_FROM)


def known_until(ledger_lines: bytes) -> str:
    """The last moment of which a copy knows who was erased; empty where it says none."""
    return _latest(ledger_lines, KNOWN_UNTIL, "erased_at")


def _latest(ledger_lines: bytes, *keys: str) -> str:
    """The latest moment under these keys; a line that a crash cut off is passed over."""
    moments = [""]
    for line in ledger_lines.splitlines():
        try:
            entry = json.loads(line)
            moments += [str(entry.get(key) or "") for key in keys]
        except (ValueError, AttributeError):
            continue
    return max(moments)


def _append(settings: Settings, key: str, runs: list[str]) -> None:
    lines = "".join(json.dumps({key: run, "erased_at": iso(now())}) + "\n" for run in runs)
    path = ledger_path(settings)
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o600), "r+b") as stream:
        stream.write(_end_of_torn_line(stream, path) + lines.encode())
        stream.flush()
        os.fsync(stream.fileno())


def _end_of_torn_line(stream: IO[bytes], path: Path) -> bytes:
    """What a line that a crash cut off lacks, so that it does not swallow the next one."""
    if stream.seek(0, os.SEEK_END) == 0:
        return b""
    stream.seek(-1, os.SEEK_END)
    if stream.read(1) == b"\n":
        return b""
    LOG.warning("%s: its last line is incomplete; the database shows whether this run was erased", path)
    return b"\n"


def ledger_content(settings: Settings) -> bytes:
    """The ledger as it is; empty where nobody was erased."""
    path = ledger_path(settings)
    return path.read_bytes() if path.is_file() else b""


def merge_ledgers(one: bytes, other: bytes) -> bytes:
    """The lines of both ledgers, each once; a line that a crash cut off is ended."""
    lines = dict.fromkeys(line for line in (one + b"\n" + other).splitlines() if line.strip())
    return b"".join(line + b"\n" for line in lines if KNOWN_UNTIL.encode() not in line)


def ledger_for_backup(settings: Settings, before: bytes, moment: str) -> bytes:
    """The ledger as it is kept next to backups: what an earlier copy names too, and until when it knows."""
    return (
        merge_ledgers(before, ledger_content(settings)) + json.dumps({KNOWN_UNTIL: moment}).encode() + b"\n"
    )


def add_to_ledger(settings: Settings, further: bytes) -> None:
    """Add what another copy of the ledger names.

    Parameters
    ----------
    further : bytes
        The copy, as it lies next to a backup.
    """
    both = merge_ledgers(ledger_content(settings), further)
    if both == ledger_content(settings):
        return
    with whole_private_file(ledger_path(settings)) as stream:
        stream.write(both)


def erasures_in_ledger(settings: Settings) -> list[str]:
    """The runs that were erased; a line that a crash cut off is passed over."""
    return _runs_under_key(settings, "run")


def identifier_erasures_in_ledger(settings: Settings) -> list[str]:
    """The runs of which it was erased who took part."""
    return _runs_under_key(settings, "identifiers_of")


def _runs_under_key(settings: Settings, key: str) -> list[str]:
    path = ledger_path(settings)
    if not path.is_file():
        return []
    runs: dict[str, None] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            runs[json.loads(line)[key]] = None
        except (ValueError, KeyError, TypeError):
            continue
    return list(runs)
