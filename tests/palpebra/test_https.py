"""`palpebra serve`: a certificate from a real authority on this machine, and what can go wrong before."""

import json
import os
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from experiments.errors import InputError
from palpebra.https import SECONDS_TO_FAIL, check_certificate, last_error, proxy_rules, tls_lines
from tests.helpers.ports import free_port
from tests.helpers.waiting import until

CADDY = shutil.which("caddy")
AUTHORITY = """\
{{
	admin off
	skip_install_trust
	http_port {http}
	https_port {https}
	storage file_system {store}
	servers {{
		protocols h1 h2  # no UDP: `free_port` holds that port of the same number
	}}
}}
https://localhost:{https} {{
	tls internal
	acme_server
}}
"""


def serve(
    *arguments: str | Path, folder: Path, path: str = os.environ["PATH"]
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "palpebra", "serve", "--folder", folder / "data", *arguments],
        env={**os.environ, "HOME": str(folder), "PATH": path},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def is_answered(port: int) -> bool:
    """Whether something listens on a port of this machine."""
    try:
        socket.create_connection(("127.0.0.1", port), 5).close()
    except OSError:
        return False
    return True


def can_use_low_ports() -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", 443))
        except OSError:
            return False
    return True


@pytest.fixture
def domain() -> str:
    """A name of this machine; the authority looks at its ports 80 and 443."""
    if CADDY is None:
        pytest.skip("no caddy on this machine")
    name = socket.gethostname()
    try:
        is_here = socket.gethostbyname(name).startswith("127.")
    except OSError:
        is_here = False
    if not is_here or is_answered(80) or is_answered(443) or not can_use_low_ports():
        pytest.skip("the name of this machine does not lead to it, or ports 80 and 443 are taken")
    return name


@pytest.fixture
def authority(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """Directory URL and root certificate of a certificate authority on this machine: another Caddy."""
    assert CADDY is not None
    store, http, https = tmp_path / "authority", free_port(), free_port()
    config = tmp_path / "authority.caddy"
    config.write_text(AUTHORITY.format(http=http, https=https, store=store), encoding="utf-8")
    root = store / "pki" / "authorities" / "local" / "root.crt"
    command = [CADDY, "run", "--config", config, "--adapter", "caddyfile"]
    with subprocess.Popen(
        command, stderr=subprocess.DEVNULL, env={**os.environ, "HOME": str(tmp_path)}
    ) as run:
        until(lambda: root.is_file() and is_answered(https))
        yield f"https://localhost:{https}/acme/local/directory", root
        run.terminate()


@pytest.mark.parametrize("ending", ["terminate", "kill"])
def test_certificate_is_fetched_and_pages_are_served(
    tmp_path: Path, domain: str, authority: tuple[str, Path], ending: str
) -> None:
    directory, root = authority
    options = ["--domain", domain, "--acme", directory, "--acme-root", root, "--port", str(free_port())]
    command = [sys.executable, "-m", "palpebra", "serve", "--folder", tmp_path / "data", *options]
    log = tmp_path / "log"
    with (
        log.open("wb") as stream,
        subprocess.Popen(
            command, stdout=stream, stderr=stream, env={**os.environ, "HOME": str(tmp_path)}
        ) as process,
    ):
        try:
            trusted = ssl.create_default_context(cafile=root)
            until(lambda: process.poll() is not None or page(f"https://{domain}/healthz", trusted) == 200)
            assert process.poll() is None, log.read_text()
            assert page(f"https://{domain}/admin/", trusted) == 200
            assert page(f"https://{domain}/readyz", trusted) == 404  # not for the world
            until(lambda: "Caddy got the certificate." in log.read_text())
            until(lambda: f"Open https://{domain}/admin/start#" in log.read_text())
        finally:
            getattr(process, ending)()
    assert (tmp_path / "data" / "address").read_text() == f"https://{domain}\n"
    until(lambda: not is_answered(443))  # Caddy ended with the server


def test_server_ends_if_caddy_is_killed(tmp_path: Path, domain: str) -> None:
    certificate, key = own_certificate(tmp_path, domain)
    options = ["--domain", domain, "--certificate", certificate, "--key", key, "--port", str(free_port())]
    command = [sys.executable, "-m", "palpebra", "serve", "--folder", tmp_path / "data", *options]
    with subprocess.Popen(
        command, env={**os.environ, "HOME": str(tmp_path)}, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            until(lambda: process.poll() is not None or is_answered(443))
            time.sleep(SECONDS_TO_FAIL + 1)  # from then on Caddy is watched
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            caddy = [int(pid) for pid in children if Path(f"/proc/{pid}/comm").read_text() == "caddy\n"]
            assert len(caddy) == 1
            os.kill(caddy[0], signal.SIGKILL)
            errors = process.communicate(timeout=60)[1]
            assert process.returncode == 2
            assert "error: Caddy ended: " in errors
            assert "the server stopped" in errors
        finally:
            process.kill()


def page(url: str, trusted: ssl.SSLContext) -> int:
    try:
        with urllib.request.urlopen(url, timeout=10, context=trusted) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code
    except OSError:
        return 0


def test_port_in_use_is_one_line(tmp_path: Path, domain: str) -> None:
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(("0.0.0.0", 443))
        taken.listen()
        certificate, key = own_certificate(tmp_path, domain)
        done = serve("--domain", domain, "--certificate", certificate, "--key", key, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: Caddy did not start: ")
    assert "443: bind: address already in use; ports 80 and 443 must be free" in done.stderr
    assert done.stderr.count("\n") == 1


def own_certificate(folder: Path, domain: str = "lab") -> tuple[Path, Path]:
    certificate, key = folder / "own.pem", folder / "own.key"
    command = ["openssl", "req", "-x509", "-newkey", "ed25519", "-nodes", "-subj", "/CN=lab", "-days", "2"]
    command += ["-addext", f"subjectAltName=DNS:{domain}"]
    subprocess.run([*command, "-out", certificate, "-keyout", key], check=True, capture_output=True)
    return certificate, key


def test_missing_caddy_is_named_with_how_to_install_it(tmp_path: Path) -> None:
    done = serve("--domain", "lab.example.org", folder=tmp_path, path=str(tmp_path))
    assert done.returncode == 2
    assert (
        "the program caddy, and it was not found; install it (Debian: sudo apt install caddy" in done.stderr
    )
    assert not (tmp_path / "data").exists()


@pytest.mark.skipif(CADDY is None, reason="no caddy on this machine")
@pytest.mark.parametrize("domain", ["https://lab.example.org", "lab", "127.0.0.1", "lab_1.example.org", ""])
def test_domain_is_a_host_name(tmp_path: Path, domain: str) -> None:
    done = serve("--domain", domain, folder=tmp_path)
    assert done.returncode == 2
    assert f"--domain: expected a host name such as lab.example.org, got '{domain}'" in done.stderr
    assert not (tmp_path / "data").exists()


def test_half_a_certificate_is_refused(tmp_path: Path) -> None:
    there = tmp_path / "lab.pem"
    there.touch()
    with pytest.raises(InputError, match="--key is missing"):
        tls_lines(there, None, "", None)
    with pytest.raises(InputError, match=r"absent\.pem: expected a PEM file, got none"):
        tls_lines(there, tmp_path / "absent.pem", "", None)
    with pytest.raises(InputError, match="expected --acme URL"):
        tls_lines(None, None, "", there)


def test_certificate_must_be_one_that_browsers_accept(tmp_path: Path) -> None:
    certificate, key = own_certificate(tmp_path, "lab.example.org")
    check_certificate(certificate, key, "Lab.example.org")
    with pytest.raises(InputError, match=r"is for lab\.example\.org; expected one for other\.example\.org"):
        check_certificate(certificate, key, "other.example.org")
    (tmp_path / "second").mkdir()
    wild, wild_key = own_certificate(tmp_path / "second", "*.example.org")
    check_certificate(wild, wild_key, "lab.example.org")
    with pytest.raises(InputError, match=r"is for \*\.example\.org; expected one for a\.lab\.example\.org"):
        check_certificate(wild, wild_key, "a.lab.example.org")
    with pytest.raises(InputError, match="is not the key of"):
        check_certificate(certificate, wild_key, "lab.example.org")
    with pytest.raises(InputError, match="expected a PEM certificate"):
        check_certificate(key, key, "lab.example.org")
    with pytest.raises(InputError, match="expected a PEM private key"):
        check_certificate(certificate, certificate, "lab.example.org")


def test_certificate_out_of_date_is_refused(tmp_path: Path) -> None:
    command = [
        "openssl",
        "x509",
        "-req",
        "-days",
        "0",
        "-in",
        tmp_path / "request",
        "-out",
        tmp_path / "old.pem",
    ]
    (tmp_path / "names").write_text("subjectAltName=DNS:lab.example.org\n", encoding="utf-8")
    _, key = own_certificate(tmp_path, "lab.example.org")
    asked = ["openssl", "req", "-new", "-key", key, "-subj", "/CN=lab", "-out", tmp_path / "request"]
    subprocess.run(asked, check=True, capture_output=True)
    command += ["-extfile", tmp_path / "names", "-signkey", key]
    subprocess.run(command, check=True, capture_output=True)
    time.sleep(1.1)  # it is valid for the second in which it was made
    with pytest.raises(InputError, match="which is not today"):
        check_certificate(tmp_path / "old.pem", key, "lab.example.org")


def test_reason_is_that_of_the_last_whole_line(tmp_path: Path) -> None:
    log = tmp_path / "caddy.log"
    log.write_text('{"level":"error","error":"no route"}\n{"level":"error","er', encoding="utf-8")
    assert last_error(log) == "no route"


@pytest.mark.skipif(CADDY is None, reason="no caddy on this machine")
def test_rules_are_valid_for_caddy(tmp_path: Path) -> None:
    assert CADDY is not None
    store = tmp_path / "with blank and ü"
    rules = proxy_rules("lab.example.org", 8123, [], store=store, email="me@example.org")
    file = tmp_path / "Caddyfile"
    file.write_text(rules, encoding="utf-8")
    command = [CADDY, "adapt", "--config", file, "--adapter", "caddyfile"]
    adapted = subprocess.run(command, check=True, capture_output=True, text=True)
    assert '"dial":"127.0.0.1:8123"' in adapted.stdout
    assert "lab.example.org" in adapted.stdout
    assert json.loads(adapted.stdout)["storage"]["root"] == str(store)
    assert "me@example.org" in adapted.stdout
