"""Palpebra, oTree and Potato: installed into empty environments and started in turn, in the same run.

`python -m bench.installation` prints the size (MiB) of each environment, and the time from the start to the
first page. Palpebra comes from the wheel in `dist` (`make wheel`).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import psutil

from bench.harness import ROOT, cpu_s_of, say, with_children
from bench.otree import VERSION, write_project
from tests.helpers.ports import free_port

POTATO = "2.12.1"
INSTALL_S, START_S = 600.0, 120.0
POTATO_CONFIG = """\
annotation_task_name: ratings
task_dir: .
output_annotation_dir: annotation_output
output_annotation_format: json
data_files: [items.json]
item_properties: {id_key: id, text_key: text}
user_config: {allow_all_users: true, users: []}
annotation_schemes:
  - annotation_type: likert
    name: naturalness
    description: How natural?
    size: 7
    min_label: unnatural
    max_label: natural
"""


class UnavailableError(Exception):
    """A program cannot be installed or started here; the message says why."""


class Installed(NamedTuple):
    """What one program takes."""

    program: str
    size_mib: float
    install_s: float
    start_s: float
    start_cpu_s: float


def installed_programs(wheel: Path) -> list[Installed]:
    """Install and start each program in turn.

    Parameters
    ----------
    wheel : pathlib.Path
        The wheel of Palpebra.

    Raises
    ------
    UnavailableError
        One of them does not install or start, for example without a network.
    """
    with tempfile.TemporaryDirectory(prefix="palpebra-installed-") as name:
        folder = Path(name)
        return [
            _measure(
                "Palpebra", folder, str(wheel), ["palpebra", "--no-browser", "--folder", "data"], "/admin/"
            ),
            _measure("oTree", folder, f"otree=={VERSION}", ["otree", "prodserver"], "/"),
            _measure(
                "Potato", folder, f"potato-annotation=={POTATO}", ["potato", "start", "config.yaml"], "/"
            ),
        ]


def _measure(program: str, folder: Path, package: str, command: Sequence[str], page: str) -> Installed:
    environment, work = folder / program / "environment", folder / program / "work"
    work.mkdir(parents=True)
    uv = str(Path(sys.executable).with_name("uv"))
    begun = time.monotonic()
    _run([uv, "venv", "-q", "--python", sys.executable, str(environment)], folder)
    # Copies, not links: so that the size is what a disk without uv's cache holds.
    _run(
        [
            uv,
            "pip",
            "install",
            "-q",
            "--link-mode=copy",
            "--python",
            str(environment / "bin/python"),
            package,
        ],
        folder,
    )
    install_s = time.monotonic() - begun
    size = sum(path.lstat().st_blocks * 512 for path in environment.rglob("*"))
    if program == "oTree":
        write_project(work)
        _run([str(environment / "bin/otree"), "resetdb", "--noinput"], work)
    elif program == "Potato":
        (work / "config.yaml").write_text(POTATO_CONFIG, encoding="utf-8")
        (work / "items.json").write_text('[{"id": "1", "text": "one"}]', encoding="utf-8")
    port = free_port()
    last = [str(port)] if program == "oTree" else ["--port", str(port)]
    start_s, cpu_s = _started([str(environment / "bin" / command[0]), *command[1:], *last], work, port, page)
    return Installed(program, size / 2**20, install_s, start_s, cpu_s)


def _started(command: Sequence[str], work: Path, port: int, page: str) -> tuple[float, float]:
    """Seconds and processor seconds until the page is there."""
    path = f"{Path(command[0]).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {"HOME": str(work), "PATH": path, "LANG": "C.UTF-8"}
    begun = time.monotonic()
    with (work / "log").open("wb") as log:
        running = subprocess.Popen(command, cwd=work, env=environment, stdout=log, stderr=log)
    try:
        while not _is_there(port, page):
            if running.poll() is not None or time.monotonic() > begun + START_S:
                raise UnavailableError(f"{command[0]} did not start: {(work / 'log').read_text()[-300:]}")
            time.sleep(0.05)
        return time.monotonic() - begun, cpu_s_of(with_children(running.pid))
    finally:
        for process in reversed(with_children(running.pid)):
            with suppress(psutil.NoSuchProcess):
                process.terminate()
        running.wait(30)


def _is_there(port: int, page: str) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{page}", timeout=5) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def _run(command: Sequence[str], folder: Path) -> None:
    try:
        subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, timeout=INSTALL_S)
    except (OSError, subprocess.SubprocessError) as error:
        said = str(getattr(error, "stderr", "") or error).strip()
        raise UnavailableError(f"{' '.join(command[:4])}: {said[-200:]}") from error


def main() -> int:
    """Print the table."""
    wheels = sorted((ROOT / "dist").glob("palpebra-*.whl"))
    if not wheels:
        sys.stderr.write("error: expected a wheel in dist, got none; run `make wheel`\n")
        return 2
    say(
        "| program | installed, MiB | installing, s | first page, s | first page, CPU s |\n"
        "|---|---|---|---|---|"
    )
    for row in installed_programs(wheels[-1]):
        figures = f"{row.size_mib:.0f} | {row.install_s:.0f} | {row.start_s:.1f} | {row.start_cpu_s:.1f}"
        say(f"| {row.program} | {figures} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
