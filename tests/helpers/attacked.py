"""A real server process to attack over HTTP."""

import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from server.accounts.identity import Scope
from server.accounts.service import create_account
from server.context import Services
from server.core.settings import Settings
from server.core.values import hash_token, new_token
from server.models import ApiToken
from tests.helpers.admins import PASSWORD
from tests.helpers.ports import free_port
from tests.helpers.studies import StudyInDatabase
from tests.server.test_durability import start


@dataclass(frozen=True)
class Attacked:
    """A running server process."""

    port: int
    process: psutil.Process

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def memory_mb(self) -> float:
        """Highest resident memory of the process so far, MB (Linux)."""
        status = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        [line] = [line for line in status if line.startswith("VmHWM")]
        return int(line.split()[1]) / 1024


@pytest.fixture
def attacked(services: Services, settings: Settings, study: StudyInDatabase) -> Iterator[Attacked]:
    """`server run` on the short study."""
    port = free_port()
    services.database.engine.dispose()
    process = start(settings, port)
    yield Attacked(port, psutil.Process(process.pid))
    os.killpg(process.pid, signal.SIGTERM)
    process.wait(30)


def api_token(services: Services, *scopes: Scope, name: str = "script") -> str:
    """A token of a fresh owner's account."""
    secret = new_token()
    with services.database.write() as session:
        account = create_account(session, name, PASSWORD, "owner")
        row = ApiToken(
            account_id=account.id, name="attack", token_hash=hash_token(secret), scopes=list(scopes)
        )
        session.add(row)
    return secret
