"""Several hosts of one server: a process and a data folder each; one database, store and shared folder."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx2 as httpx

from server.core.settings import Settings
from tests.helpers.ports import free_port

SECRET = "the same on every host"
START_LIMIT_S = 60.0


@dataclass
class Host:
    """A host of a server, started."""

    address: str
    settings: Settings
    process: "subprocess.Popen[bytes]"
    browsers: list[httpx.Client] = field(default_factory=list)

    def kill(self) -> None:
        """End it, and all it started, as the loss of the machine would."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def browser(self) -> httpx.Client:
        """A browser that talks to this host, closed with it; its cookies are good for every host."""
        opened = httpx.Client(base_url=self.address, timeout=60, headers={"origin": self.address})
        self.browsers.append(opened)
        return opened


def settings_of(folder: Path, name: str, database_url: str, store: str, **further: object) -> Settings:
    """The settings of the host called `name`."""
    values = {
        "data_folder": folder / name,
        "shared_folder": folder / "shared",
        "database_url": database_url,
        "secret_key": SECRET,
        "s3_bucket": "clips",
        "s3_endpoint": store,
    }
    return Settings(**values | further)  # type: ignore[arg-type]


@contextmanager
def running(settings: Settings) -> Iterator[Host]:
    """A host with these settings."""
    port = free_port()
    environment = {
        **os.environ,
        "PALPEBRA_DATA_FOLDER": str(settings.data_folder),
        "PALPEBRA_SHARED_FOLDER": str(settings.shared_folder),
        "PALPEBRA_SECRET_KEY": settings.secret_key,
        "PALPEBRA_S3_BUCKET": settings.s3_bucket,
        "PALPEBRA_S3_ENDPOINT": settings.s3_endpoint,
        "PALPEBRA_PUBLIC_URL": f"http://127.0.0.1:{port}",
        "PALPEBRA_LOGINS_PER_MINUTE": str(settings.logins_per_minute),
        "DATABASE_URL": settings.database_url,
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
    }
    command = [sys.executable, "-m", "server", "run", "--port", str(port)]
    process = subprocess.Popen(command, env=environment, start_new_session=True)
    host = Host(f"http://127.0.0.1:{port}", settings, process)
    try:
        _wait(host)
        yield host
    finally:
        for browser in host.browsers:
            browser.close()
        host.kill()


def _wait(host: Host) -> None:
    until = time.monotonic() + START_LIMIT_S
    while time.monotonic() < until:
        try:
            if httpx.get(f"{host.address}/healthz", timeout=5).status_code == 200:
                return
        except httpx.HTTPError:
            pass
        time.sleep(0.1)
    raise TimeoutError("the host did not start")
