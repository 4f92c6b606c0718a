"""The ledger of erasures: a file beside the database and outside its backups, replayed at every restore.

It names runs by their public ids, which say nothing of a person.
"""

import json
import os
from pathlib import Path

from server.clock import iso, now
from server.settings import Settings


def ledger(settings: Settings) -> Path:
    """The file; it may be missing where nobody was erased yet."""
    return settings.data_folder / "erasures.ndjson"


def note(settings: Settings, runs: list[str]) -> None:
    """Write down that these runs (public ids) are erased; on disk when this returns."""
    lines = "".join(json.dumps({"run": run, "erased_at": iso(now())}) + "\n" for run in runs)
    path = ledger(settings)
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600), "w") as stream:
        stream.write(lines)
        stream.flush()
        os.fsync(stream.fileno())


def noted(settings: Settings) -> list[str]:
    """The runs that were erased; a line that a crash cut off is passed over."""
    path = ledger(settings)
    if not path.is_file():
        return []
    found: dict[str, None] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            found[json.loads(line)["run"]] = None
        except (ValueError, KeyError, TypeError):
            continue
    return list(found)
