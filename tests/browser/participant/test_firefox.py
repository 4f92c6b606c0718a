"""The whole visit in a real Firefox."""

import json
import logging
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.browser.conftest import REPOSITORY
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN

pytestmark = pytest.mark.firefox
LOG = logging.getLogger(__name__)
FRAMES = 30


def test_a_whole_visit(server: ServerProcess, tmp_path: Path) -> None:
    firefox = next((path for name in ("firefox-esr", "firefox") if (path := shutil.which(name))), None)
    if firefox is None:
        pytest.skip("no Firefox here: sudo apt-get install firefox-esr")
    if not (REPOSITORY / "frontend" / "node_modules" / "puppeteer-core").is_dir():
        pytest.skip("the frontend's packages are not installed: run `make setup-test`")
    study = server.add_study(tmp_path / "clips", PLAIN, frames=FRAMES)
    server.start()
    command = ["node", "tests/firefox/visit.mjs", firefox, f"{server.address}/run/{study.link_token}"]
    done = subprocess.run(
        command, cwd=REPOSITORY / "frontend", capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    told = json.loads(done.stdout.strip().splitlines()[-1])
    assert told["code"]
    assert told["problems"] == []
    rows = server.rows("SELECT * FROM ratings WHERE kind = 'main' AND play = 1")
    LOG.info("%s: %s", told["version"], [(r["method"], r["verdict"], r["frames_missing"]) for r in rows])
    assert [row["response"] for row in rows] == [6] * 6
    assert all(row["key_to_first_frame_ms"] is not None for row in rows)
    assert {row["run_status"] for row in rows} == {"complete"}
