"""`palpebra` with what can go wrong at a start: one clear line each, and nothing changes."""

import os
import re
import socket
import subprocess
import sys
import urllib.request
from importlib import metadata
from pathlib import Path

import pytest

from experiments.errors import InputError
from palpebra import cli
from palpebra.cli import damaged_files, refuse_broken_installation, with_start
from palpebra.folders import data_folder, free_port
from palpebra.start import only_server_of
from server.core.settings import Settings
from tests.helpers.ports import free_port as unused_port
from tests.helpers.waiting import until


def palpebra(*arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "palpebra", *arguments],
        env={**os.environ, "HOME": str(folder), **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([], ["start"]),
        (["--no-browser"], ["start", "--no-browser"]),
        (["--help"], ["--help"]),
        (["backup", "x.tar"], ["backup", "x.tar"]),
    ],
)
def test_no_command_means_start(given: list[str], expected: list[str]) -> None:
    assert with_start(given) == expected


def test_port_in_use_is_refused_if_wanted_and_passed_over_if_not() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port} is in use; choose a free one by --port"):
            free_port(port)
    assert free_port(port) == port
    assert free_port(None) >= 8000


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_that_cannot_be_written_to(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="expected a writable folder"):
        data_folder(tmp_path / "data")


def test_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="choose another by --folder"):
        data_folder(tmp_path / "data")


def test_default_folder_is_the_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PALPEBRA_DATA_FOLDER", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert data_folder(None) == tmp_path / "palpebra"


def test_second_server_of_a_folder_is_refused(tmp_path: Path) -> None:
    with only_server_of(tmp_path):
        done = palpebra("--folder", str(tmp_path), "--no-browser", folder=tmp_path)
    assert done.returncode == 2
    assert "another palpebra is serving" in done.stderr
    assert not (tmp_path / "palpebra.sqlite").exists()


def test_package_of_another_project_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "migrations").mkdir()
    (tmp_path / "migrations" / "__init__.py").write_text("", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "migrations", raising=False)
    expected = r"package 'migrations': expected Palpebra's, got the one in .*: uv tool install FILE\.whl$"
    with pytest.raises(InputError, match=expected):
        refuse_broken_installation()


def test_a_damaged_record_is_no_traceback(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "palpebra-1.dist-info"
    folder.mkdir()
    (tmp_path / "whole.py").write_text("x", encoding="utf-8")
    record = "whole.py,sha256=a,1\n\nshort.py,sha256=a,5\npalpebra-1.dist-info/RECORD,,\ncut.py,sha2"
    (folder / "RECORD").write_text(record, encoding="utf-8")
    monkeypatch.setattr(metadata, "distribution", lambda _: metadata.Distribution.at(folder))
    assert damaged_files() == ["short.py", "cut.py"]
    with pytest.raises(InputError, match=r"short\.py and 1 more are missing or have another size; install"):
        refuse_broken_installation()


def test_upgrade_backs_up_first_and_names_both(tmp_path: Path) -> None:
    data = tmp_path / "data"
    assert "nothing to upgrade" in palpebra("upgrade", "--folder", str(data), folder=tmp_path).stderr
    environment = {**os.environ, "PALPEBRA_DATA_FOLDER": str(data)}
    server = [sys.executable, "-m", "server"]
    subprocess.run([*server, "database", "upgrade"], env=environment, check=True, capture_output=True)
    done = palpebra("upgrade", "--folder", str(data), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    (kept,) = (data / "backups").glob("palpebra-*.tar")
    assert str(kept) in done.stdout
    assert "uv tool install --force" in done.stdout
    elsewhere = tmp_path / "new" / "folder" / "monday.tar"
    done = palpebra("backup", str(elsewhere), "--folder", str(data), folder=tmp_path)
    assert (done.returncode, elsewhere.is_file()) == (0, True), done.stderr


def test_database_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    import sqlite3

    data = tmp_path / "data"
    environment = {**os.environ, "PALPEBRA_DATA_FOLDER": str(data)}
    server = [sys.executable, "-m", "server"]
    subprocess.run([*server, "database", "upgrade"], env=environment, check=True, capture_output=True)
    with sqlite3.connect(data / "palpebra.sqlite") as database:
        database.execute("UPDATE alembic_version SET version_num = '9999'")
    done = palpebra("--folder", str(data), "--no-browser", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "newer version" in done.stderr


def test_programs_keep_their_own_command_lines(tmp_path: Path) -> None:
    done = palpebra("analysis", "anova", "--help", folder=tmp_path)
    assert done.returncode == 0
    assert "analysis anova [OPTIONS]" in done.stdout


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ([], "start --no-browser --port 8000"),
        (["--domain", "lab.example.org"], "serve --domain lab.example.org --port 8000"),
        (["--domain", "lab.example.org", "--own-proxy"], "start --no-browser --port 8000"),
    ],
)
def test_service_writes_a_unit(tmp_path: Path, options: list[str], line: str) -> None:
    out = tmp_path / "palpebra.service"
    given = ["--folder", str(tmp_path / "data"), "--out", str(out), *options]
    done = palpebra("service", "install", *given, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    text = out.read_text(encoding="utf-8")
    assert f"Environment=PALPEBRA_DATA_FOLDER={tmp_path / 'data'}" in text
    assert re.search(rf"^ExecStart=.*palpebra {line}$", text, re.MULTILINE)
    assert ("PALPEBRA_PUBLIC_URL=https://lab.example.org" in text) == ("--own-proxy" in options)
    assert ("CAP_NET_BIND_SERVICE" in text) == ("serve" in line)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--domain", "https://lab.example.org"], "--domain: expected a host name"),
        (["--own-proxy"], "--own-proxy is for a domain: expected --domain NAME with it"),
    ],
)
def test_a_unit_that_cannot_work_is_not_written(tmp_path: Path, options: list[str], said: str) -> None:
    out = tmp_path / "palpebra.service"
    done = palpebra("service", "install", "--out", str(out), *options, folder=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not out.exists()


def test_server_starts_without_extras_and_without_what_only_unix_has(tmp_path: Path) -> None:
    port, log = unused_port(), tmp_path / "log"
    program = Path(__file__).with_name("without_unix.py")
    command = [sys.executable, program, "--folder", tmp_path / "data", "--port", str(port), "--no-browser"]
    # A proxy of the network cannot reach this machine's own server.
    behind_a_proxy = {"http_proxy": f"http://127.0.0.1:{unused_port()}", "no_proxy": ""}
    environment = {**os.environ, "HOME": str(tmp_path), **behind_a_proxy}
    with (
        log.open("wb") as stream,
        subprocess.Popen(command, env=environment, stdout=stream, stderr=stream) as process,
    ):
        try:
            until(lambda: "Stop with Ctrl-C" in log.read_text() or process.poll() is not None)
            assert answers(port, "/healthz"), log.read_text()  # people may follow the link at once
            until(lambda: answers(port, "/readyz"))
            assert answers(port, "/admin/") or not Settings().frontend_folder.is_dir()
            link = palpebra(
                "server", "admin", "link", folder=tmp_path, PALPEBRA_DATA_FOLDER=f"{tmp_path}/data"
            )
            assert link.stdout.startswith(f"http://localhost:{port}/admin/invitation#")
        finally:
            process.terminate()
    # On a line alone, set apart from the lines before and from the log.
    pattern = rf"\n\nOpen http://localhost:{port}/admin/start#\S+\n\nStop with Ctrl-C"
    assert re.search(pattern, log.read_text())


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_server_run_prints_its_links_once_it_answers(tmp_path: Path, host: str) -> None:
    port, log = unused_port(), tmp_path / "log"
    command = [sys.executable, "-m", "server", "run", "--welcome", "--host", host, "--port", str(port)]
    environment = {**os.environ, "PALPEBRA_DATA_FOLDER": str(tmp_path / "data")}
    with (
        log.open("wb") as stream,
        subprocess.Popen(command, env=environment, stdout=stream, stderr=stream) as process,
    ):
        try:
            until(lambda: "admin site" in log.read_text() or process.poll() is not None)
            assert answers(port, "/healthz"), log.read_text()  # people may follow the link at once
            until(lambda: "create the first account" in log.read_text())
        finally:
            process.terminate()
    assert f"admin site: http://localhost:{port}/admin/" in log.read_text()


def answers(port: int, path: str) -> bool:
    """Whether the server answers a request with 200."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def test_what_the_program_writes_is_for_its_own_user_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    masks = []

    def noted(**_: object) -> int:
        masks.append(os.umask(0o022))
        os.umask(masks[-1])
        return 0

    monkeypatch.setattr(cli, "_checked_app", noted)
    monkeypatch.setattr("sys.argv", ["palpebra", "--no-browser"])
    with pytest.raises(SystemExit):
        cli.main()
    assert masks == [0o077]
