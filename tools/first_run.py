"""`make run`: clips, documentation, database, the three studies and the server; then prints where to go.

Every step is skipped where nothing has changed, so that a later run starts in seconds.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BIN = ROOT / ".venv" / ("Scripts" if os.name == "nt" else "bin")
DATA = Path(os.environ.get("PALPEBRA_DATA_FOLDER") or ROOT / "data")
STUDIES = ("exp3", "exp1", "exp2")


def call(*command: str) -> None:
    done = subprocess.run([BIN / command[0], *command[1:]], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def sources() -> str:
    """One hash over everything that decides what the studies are: programs, characters, declarations."""
    sha = hashlib.sha256(os.environ.get("DATABASE_URL", "").encode())
    folders = (ROOT / "stimuli_builder", ROOT / "experiments", ROOT / "server" / "studies")
    for path in sorted(path for folder in folders for path in folder.rglob("*") if path.is_file()):
        if "__pycache__" not in path.parts:
            sha.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return sha.hexdigest()


def studies_made() -> dict[str, bool]:
    """Every study that the server's database has or had, and whether it is still there and not archived."""
    from sqlalchemy import text

    from server.core.db import open_database
    from server.core.settings import Settings

    database = open_database(Settings())
    try:
        with database.read() as session:
            made = session.scalars(text("SELECT target FROM audit_entries WHERE action = 'study created'"))
            in_use = session.execute(text("SELECT name, archived_at IS NULL FROM studies"))
            return dict.fromkeys(made, False) | {name: bool(used) for name, used in in_use}
    finally:
        database.close()


def is_current(study: str, stamp_text: str, made: Mapping[str, bool]) -> bool:
    """Whether nothing is to be done: the stamp fits, or the study was archived, deleted or closed."""
    stamp = DATA / "stimuli" / study / ".first_run"
    return study in made and (not made[study] or (stamp.is_file() and stamp.read_text() == stamp_text))


def prepare(study: str, stamp_text: str, made: Mapping[str, bool]) -> None:
    """Build a study's clips and take it into the server; nothing where the stamp says `stamp_text`.

    The stamp lies with the clips, which may be older than the database or copied from another clone: a study
    that is not among those `made` in this database is taken in all the same, and set live. One that was
    archived, deleted or closed on purpose stays so.
    """
    folder = DATA / "stimuli" / study
    stamp = folder / ".first_run"
    if is_current(study, stamp_text, made):
        return
    print(
        f"[clips] {study} ({STUDIES.index(study) + 1} of {len(STUDIES)}): rendering what is missing",
        flush=True,
    )
    call("stimuli", "build", study, "--out", str(folder), "--quiet-when-current")
    opened = [] if study in made else ["--open", "--no-link"]
    call("server", "study", "add", study, "--clips", str(folder), *opened)
    stamp.write_text(stamp_text)


def draw_strips(stamp_text: str) -> None:
    """The characters for the dashboard's blinks page; nothing where the stamp says `stamp_text`."""
    folder = DATA / "stimuli" / "strips"
    stamp = folder / ".first_run"
    if stamp.is_file() and stamp.read_text() == stamp_text:
        return
    call("stimuli", "strips", "--out", str(folder))
    stamp.write_text(stamp_text)


def build_docs_meanwhile() -> None:
    """Build the documentation site in the background: what it says goes to a file.

    The first run renders clips for longer than this takes. A later run does not wait for it, so the server
    shows the old site, or a page that says what is missing, for half a minute.
    """
    log = ROOT / "build" / "docs.log"
    log.parent.mkdir(exist_ok=True)
    print("[docs] the site at /docs is built in the background where it is not current", flush=True)
    with log.open("w", encoding="utf-8") as file:
        subprocess.Popen([BIN / "python", "tools/setup.py", "docs"], cwd=ROOT, stdout=file, stderr=file)


def main() -> None:
    DATA.mkdir(parents=True, exist_ok=True)
    build_docs_meanwhile()
    port = os.environ.get("PORT", "8000")
    os.environ["PALPEBRA_DATA_FOLDER"] = str(DATA)
    # For people, also where the output is not a terminal.
    os.environ.setdefault("PALPEBRA_LOG_FORMAT", "text")
    os.environ.setdefault("PALPEBRA_PUBLIC_URL", f"http://localhost:{port}")  # links name it before the start
    call("server", "database", "upgrade")
    stamp_text, made = sources(), studies_made()
    if due := [study for study in STUDIES if not is_current(study, stamp_text, made)]:
        # The server starts afterwards: clips that are rendered while somebody rates would disturb playback.
        print(
            f"[clips] to build: {', '.join(due)}. The first time takes a few minutes. The links are printed "
            "once the server runs.",
            flush=True,
        )
    for study in STUDIES:
        prepare(study, stamp_text, made)
    draw_strips(stamp_text)
    os.execv(BIN / "palpebra", ["palpebra", "--folder", str(DATA), "--port", port, "--no-browser"])


if __name__ == "__main__":
    main()
