"""A real `server run` in a separate process, that can be killed and started again on the same data."""

import os
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from sqlalchemy import make_url, text

from experiments.load import parse_experiment
from experiments.manifest import read_manifest
from server.cli_common import migrated_services
from server.context import Services, open_services
from server.core.settings import Settings
from server.studies.creation import add_version, create_study, store_clips
from server.studies.links import LinkKind, create_link
from tests.helpers.databases import migrated_sqlite
from tests.helpers.ports import free_port
from tests.helpers.studies import StudyInDatabase, add_study, link_token

START_LIMIT_S = 240.0


class ServerProcess:
    """The server on a data folder. `kill` is kill -9; `start` after it takes the same port.

    further: other settings, by their names in `Settings`.
    """

    def __init__(self, data_folder: Path, **further: str) -> None:
        self.settings = Settings(
            data_folder=data_folder, secret_key="a key of the browser tests, long enough", **further
        )
        self.further = {f"PALPEBRA_{name.upper()}": value for name, value in further.items()}
        self.port = free_port()
        self.log = data_folder.with_suffix(".log")
        self.process: subprocess.Popen[bytes] | None = None
        self._migrated = False

    @contextmanager
    def services(self) -> Iterator[Services]:
        """Database and clips of the server: a new database is a copy of one that was migrated."""
        path = Path(make_url(self.settings.resolved_database_url).database or "")
        if not self._migrated and not self.settings.database_url and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(migrated_sqlite(), path)
            self._migrated = True
        if not self._migrated:
            with migrated_services(self.settings):
                self._migrated = True
        opened = open_services(self.settings)
        try:
            yield opened
        finally:
            opened.database.close()

    @property
    def address(self) -> str:
        return f"http://localhost:{self.port}"

    def add_study(self, folder: Path, declaration: str, frames: int = 8) -> StudyInDatabase:
        """Add a declaration with tiny clips, live; its `link_token` leads to /run/."""
        with self.services() as services:
            return add_study(services, folder, declaration, frames=frames)

    def add_built_study(self, folder: Path, declaration: str) -> StudyInDatabase:
        """Add a declaration with the clips that `stimuli build` made for it, live."""
        experiment, manifest = parse_experiment(declaration), read_manifest(folder)
        with self.services() as services:
            store_clips(services.clips, manifest, folder)
            with services.database.write() as session:
                study = create_study(session, experiment.name, experiment, None)
                add_version(session, study, declaration, experiment, manifest, None)
                study.status = "live"
                link = create_link(session, services.settings.key, study, "general")
                return StudyInDatabase(services, experiment.name, experiment, link_token(services, link))

    def link(self, study: StudyInDatabase, kind: LinkKind, **options: Any) -> str:
        """The token of a new link, made while the server runs."""
        with self.services() as services:
            return replace(study, services=services).link(kind, **options)

    def change(self, statement: str) -> None:
        """Change the server's database behind its back."""
        with self.services() as services, services.database.write() as session:
            session.execute(text(statement))

    def rows(self, statement: str) -> list[dict[str, Any]]:
        """What an SQL query gives on the server's database."""
        with self.services() as services, services.database.read() as session:
            return [dict(row) for row in session.execute(text(statement)).mappings()]

    def rows_soon(self, statement: str, count: int, limit_s: float = 30.0) -> list[dict[str, Any]]:
        """As `rows`, after waiting until there are `count`: the page sends while the participant goes on."""
        limit = time.monotonic() + limit_s
        found = self.rows(statement)
        while len(found) < count and time.monotonic() < limit:
            time.sleep(0.05)
            found = self.rows(statement)
        return found

    def start(self) -> "ServerProcess":
        environment = os.environ | self.further
        environment |= {
            "PALPEBRA_DATA_FOLDER": str(self.settings.data_folder),
            "PALPEBRA_SECRET_KEY": self.settings.secret_key,
        }
        self.process = self._launch(environment)
        self._wait()
        return self

    def _launch(self, environment: dict[str, str]) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", *self._arguments()]
        with self.log.open("ab") as log:
            return subprocess.Popen(command, env=environment, stdout=log, stderr=log)

    def _arguments(self) -> list[str]:
        return ["server", "run", "--port", str(self.port)]

    def kill(self) -> None:
        """End it as a power cut would."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        self._end(signal.SIGTERM)

    def _end(self, how: signal.Signals) -> None:
        if self.process is not None:
            self.process.send_signal(how)
            self.process.wait(timeout=30)
            self.process = None

    def _wait(self) -> None:
        limit = time.monotonic() + START_LIMIT_S
        while time.monotonic() < limit:
            if self.process is not None and self.process.poll() is not None:
                raise RuntimeError(f"the server ended at once:\n{self.log.read_text()[-3000:]}")
            try:
                with urllib.request.urlopen(f"{self.address}/healthz", timeout=2):
                    return
            except (urllib.error.URLError, ConnectionError, TimeoutError):
                time.sleep(0.02)
        raise RuntimeError(f"the server did not answer within {START_LIMIT_S:.0f} s")
