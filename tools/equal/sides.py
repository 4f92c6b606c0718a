"""The two sides of a comparison: a tree, a folder for its outputs, and processes that run its program."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.helpers.ports import free_port

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
LOCKS = ("requirements.lock", "requirements-dev.lock")
SERVER_START_S = 120.0
STABLE = {
    "COLUMNS": "100",
    "NO_COLOR": "1",
    "TZ": "UTC",
    "PYTHONHASHSEED": "0",
    "OPENBLAS_NUM_THREADS": "1",
    "SOURCE_DATE_EPOCH": "1700000000",
}
"""Environment of every process, so that width, color, zone and order of sums are the same on both sides."""


class PartError(Exception):
    """A part's outputs could not be made."""


@dataclass(frozen=True)
class Side:
    """One version of the program.

    Attributes
    ----------
    name : str
        `base` or `head`, as messages call it.
    tree : Path
        Folder of its source.
    """

    name: str
    tree: Path

    def run(self, job: Mapping[str, Any], **environment: str) -> None:
        """Run a job of `launch.py` to its end; PartError with what it said where it fails."""
        with self._process(job, environment) as process:
            output, _ = process.communicate()
            if process.returncode:
                raise PartError(f"{self.name}: {output[-3000:].strip() or process.returncode}")

    def commands(self, *commands: Mapping[str, Any], **environment: str) -> None:
        """Run commands one after another in one process."""
        self.run({"commands": list(commands)}, **environment)

    def probe(self, name: str, out: Path) -> None:
        """Run a function of `probes.py`."""
        self.run({"probe": name, "probes": str(HERE / "probes.py"), "out": str(out)})

    @contextmanager
    def server(self, **environment: str) -> Iterator[str]:
        """A running server on the data folder of the environment; gives its address."""
        port = free_port()
        job = {"commands": [command("server", "run", "--port", str(port))]}
        address = f"http://localhost:{port}"
        with self._process(job, environment) as process:
            limit = time.monotonic() + SERVER_START_S
            while not answers(f"{address}/healthz"):
                if process.poll() is not None or time.monotonic() > limit:
                    process.kill()
                    raise PartError(f"{self.name}: server run: {process.communicate()[0][-3000:]}")
                time.sleep(0.2)
            yield address
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=60)

    @contextmanager
    def _process(self, job: Mapping[str, Any], environment: Mapping[str, str]) -> Iterator[Any]:
        with tempfile.TemporaryDirectory(prefix="equal-") as folder:
            file = Path(folder) / "job.json"
            file.write_text(json.dumps(job), encoding="utf-8")
            plain = {key: value for key, value in os.environ.items() if not key.startswith("PALPEBRA_")}
            plain.pop("DATABASE_URL", None)
            process = subprocess.Popen(
                [sys.executable, str(HERE / "launch.py"), str(self.tree), str(file)],
                cwd=folder,
                env=plain | STABLE | {"PYTHONPATH": str(self.tree)} | dict(environment),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            try:
                yield process
            finally:
                if process.poll() is None:
                    process.kill()
                    process.wait()


def command(
    program: str, *arguments: object, out: Path | None = None, refusal: Path | None = None
) -> dict[str, Any]:
    """A command of a job; its output goes to `out`, a refusal to `refusal` (without it: an error)."""
    plain: dict[str, Any] = {"program": program, "arguments": [str(one) for one in arguments]}
    return plain | {name: str(path) for name, path in (("out", out), ("refusal", refusal)) if path}


def answers(url: str) -> bool:
    """Whether a server answers at an address."""
    try:
        with urllib.request.urlopen(url, timeout=2) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def git(*arguments: str) -> str:
    """What git says in this repository."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"git {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout.strip()


@contextmanager
def worktree(commit: str) -> Iterator[Path]:
    """The tree of a commit in a temporary folder outside this one, removed afterwards."""
    folder = Path(tempfile.mkdtemp(prefix="equal-base-"))
    tree = folder / "tree"
    git("worktree", "add", "--quiet", "--detach", str(tree), commit)
    try:
        yield tree
    finally:
        git("worktree", "remove", "--force", str(tree))
        shutil.rmtree(folder, ignore_errors=True)


def differing_locks(commit: str, locks: Sequence[str] = LOCKS) -> list[str]:
    """Lock files that differ between a commit and the working tree: its program needs other packages."""
    return [name for name in locks if git("show", f"{commit}:{name}") != (ROOT / name).read_text().strip()]
