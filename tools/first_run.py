"""`make run`: clips, database, the three studies and the server; then prints where to go.

Every step is skipped where nothing has changed, so that a later run starts in seconds.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BIN = ROOT / ".venv" / ("Scripts" if os.name == "nt" else "bin")
DATA = Path(os.environ.get("PALPEBRA_DATA_FOLDER", ROOT / "data"))
STUDIES = ("exp3", "exp1", "exp2")


def call(*command: str) -> None:
    done = subprocess.run([BIN / command[0], *command[1:]], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def main() -> None:
    DATA.mkdir(parents=True, exist_ok=True)
    os.environ["PALPEBRA_DATA_FOLDER"] = str(DATA)
    for study in STUDIES:
        call("stimuli", "build", study, "--out", str(DATA / "stimuli" / study), "--quiet-when-current")
    call("server", "database", "upgrade")
    for study in STUDIES:
        call("server", "study", "add", study, "--clips", str(DATA / "stimuli" / study), "--open")
    port = os.environ.get("PORT", "8000")
    os.execv(BIN / "server", ["server", "run", "--port", port, "--welcome"])


if __name__ == "__main__":
    main()
