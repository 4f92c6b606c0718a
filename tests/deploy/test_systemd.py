"""The systemd unit of the deployment guide: what systemd says of it, and what the server needs in it."""

import configparser
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

UNIT = REPOSITORY / "deploy" / "palpebra.service"


def verified(unit: Path) -> subprocess.CompletedProcess[str]:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("no systemd-analyze on this machine")
    return subprocess.run([analyze, "verify", str(unit)], capture_output=True, text=True, check=False)


def test_systemd_accepts_the_unit_and_would_not_accept_another(tmp_path: Path) -> None:
    server = Path(sys.executable).with_name("server")
    text = UNIT.read_text(encoding="utf-8").replace("/opt/palpebra/.venv/bin/server", str(server))
    for name, content in (("sound", text), ("spoiled", text.replace("PrivateTmp", "PrivateTemp"))):
        (tmp_path / f"{name}.service").write_text(content, encoding="utf-8")
    sound = verified(tmp_path / "sound.service")
    assert (sound.returncode, sound.stderr) == (0, "")
    assert "PrivateTemp" in verified(tmp_path / "spoiled.service").stderr


def test_systemd_finds_little_that_the_server_could_do_beyond_its_work() -> None:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("no systemd-analyze on this machine")
    command = [analyze, "security", "--offline=true", "--threshold=30", "--no-pager", str(UNIT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-200:]  # 1.8 by systemd 252; without what is taken away 7.3


def test_what_is_read_only_leaves_the_server_its_folders() -> None:
    """Uploads and the counts of several workers go through tempfile, everything else into the data folder."""
    unit = configparser.RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read(UNIT, encoding="utf-8")
    service = unit["Service"]
    assert service["ProtectSystem"] == "strict"
    assert service["PrivateTmp"] == "true"
    assert service["UMask"] == "0077"
    data = f"PALPEBRA_DATA_FOLDER=/var/lib/{service['StateDirectory']}"
    assert f"Environment={data}\n" in UNIT.read_text(encoding="utf-8")
