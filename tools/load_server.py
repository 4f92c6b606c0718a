"""A real server with a short study for `make load`: its own folder, its own processes, gone at the end."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from server.context import Services, open_services
from server.core.migrate import upgrade
from server.core.settings import Settings
from tests.helpers.studies import SHORT, add_study
from tools.load_database import LoadDatabase, load_database

ROOT = Path(__file__).resolve().parent.parent
START_S = 180.0
# Enough trials for minutes of rating: 2 characters x 2 speeds x 30 exemplars.
STUDY = SHORT.replace("per_cell = 2", "per_cell = 30")
CLIP_BYTES = 250_000
"""As large as the clips of Experiment 3."""


class LoadServer:
    """`server run` on a free port."""

    def __init__(
        self, settings: Settings, database: LoadDatabase, workers: int, further: Mapping[str, str]
    ) -> None:
        self.settings, self.database, self.further = settings, database, further
        self.workers, self.port = workers, free_port()
        self.services: Services = open_services(settings)
        self.link = ""
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it is ready."""
        environment = {
            **os.environ,
            "PALPEBRA_DATA_FOLDER": str(self.settings.data_folder),
            "DATABASE_URL": self.settings.database_url,
            "PALPEBRA_RUN_STARTS_PER_MINUTE": "1000000",
            # Raters here answer as fast as they are asked, and fetch clips only for their load.
            "PALPEBRA_EVIDENCE": "record",
            "PALPEBRA_LOG_REQUESTS": "none",
            "PALPEBRA_LOG_FORMAT": "text",
            **self.further,
        }
        command = [
            sys.executable,
            "-m",
            "server",
            "run",
            "--port",
            str(self.port),
            "--workers",
            str(self.workers),
        ]
        log = self.settings.data_folder / "server.log"
        with log.open("ab") as stream:
            self.process = subprocess.Popen(
                command, env=environment, cwd=ROOT, start_new_session=True, stderr=stream
            )
        ends = time.monotonic() + START_S
        while time.monotonic() < ends:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/readyz", timeout=5):
                    return
            except OSError:
                time.sleep(0.1)
        raise TimeoutError(f"the server did not become ready; it said:\n{log.read_text()[-2000:]}")

    def processes(self) -> list[psutil.Process]:
        """The server's processes, the first one first."""
        if self.process is None:
            return []
        first = psutil.Process(self.process.pid)
        return [first, *first.children(recursive=True)]

    def cpu_s(self) -> float:
        """Processor time used by all of them so far, those that ended included."""
        used = 0.0
        for process in self.processes():
            with suppress(psutil.Error):
                used += sum(process.cpu_times()[:4])
        return used

    def kill_worker(self, number: int) -> bool:
        """kill -9 of a worker (its supervisor starts another); False where there is none at the moment."""
        ends = time.monotonic() + START_S
        while time.monotonic() < ends:
            if workers := [process for process in self.processes()[1:] if _is_worker(process)]:
                workers[number % len(workers)].kill()
                return True
            time.sleep(0.05)
        return False

    def stop(self) -> float:
        """End it as an operator would; return how long that took."""
        began = time.monotonic()
        if self.process is not None:
            self.process.terminate()
            self.process.wait(60)
            self.process = None
        return time.monotonic() - began


@contextmanager
def load_server(kind: str, workers: int, **further: str) -> Iterator[LoadServer]:
    """A started server with a live study on `sqlite` or `postgres`; `further` are settings of its own."""
    folder = Path(tempfile.mkdtemp(prefix="palpebra-load-"))
    try:
        with load_database(kind, folder) as database:
            settings = Settings(data_folder=folder / "data", database_url=database.url)
            server = LoadServer(settings, database, workers, further)
            try:
                upgrade(server.services.database)
                study = add_study(server.services, folder / "clips", STUDY, frames=45, clip_bytes=CLIP_BYTES)
                server.link = study.link_token
                server.start()
                yield server
            finally:
                server.stop()
                server.services.database.close()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _is_worker(process: psutil.Process) -> bool:
    try:
        return "spawn_main" in " ".join(process.cmdline())
    except psutil.Error:  # it ended between the two looks
        return False


def free_port() -> int:
    """A port nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
