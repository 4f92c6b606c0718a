"""`palpebra serve`: the server under a domain, behind Caddy, which gets the certificate and renews it."""

import _thread
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from palpebra.folders import Folder, data_folder, free_port
from palpebra.start import Port, first_page, serve_folder

NAME = re.compile(r"(?!-)[a-z0-9-]{1,63}(?<!-)(\.(?!-)[a-z0-9-]{1,63}(?<!-))*", re.IGNORECASE)
OBTAINED = "certificate obtained successfully"
SECONDS_AFTER_CTRL_C = 15.0
SECONDS_TO_FAIL = 2.0
"""A Caddy that cannot listen ends well within this time."""
HERE = Path(__file__).resolve().parent
RULES = (HERE / "Caddyfile", HERE.parent / "deploy" / "Caddyfile")
"""The rules of the proxy: in the wheel, or in a checkout."""


def register(parent: typer.Typer) -> None:
    """Add the command."""
    parent.command("serve")(serve)


def serve(
    domain: Annotated[str, typer.Option(help="Name of the server, such as lab.example.org.")],
    folder: Folder = None,
    port: Port = None,
    email: Annotated[str, typer.Option(help="Where the certificate authority may write to you.")] = "",
    certificate: Annotated[
        Path | None, typer.Option(help="File of your own certificate (PEM, with the chain).")
    ] = None,
    key: Annotated[Path | None, typer.Option(help="File of its private key (PEM).")] = None,
    acme: Annotated[str, typer.Option(help="Directory URL of another certificate authority.")] = "",
    acme_root: Annotated[
        Path | None, typer.Option(help="File of that authority's root certificate (PEM).")
    ] = None,
) -> None:
    """Serve studies at https://DOMAIN. Caddy must be installed; it gets the certificate and renews it.

    The domain must point to this machine, and ports 80 and 443 must be reachable from outside. Stop with
    Ctrl-C.

    Examples:

        palpebra serve --domain lab.example.org

        palpebra serve --domain lab.example.org --certificate lab.pem --key lab.key
    """
    program = _caddy()
    check_name(domain, is_public=not (acme or certificate))
    tls = tls_lines(certificate, key, acme, acme_root)
    if certificate is not None and key is not None:
        check_certificate(certificate, key, domain)
    place, chosen = data_folder(folder), free_port(port)
    os.environ["PALPEBRA_PUBLIC_URL"] = f"https://{domain}"
    os.environ.setdefault("FORWARDED_ALLOW_IPS", "127.0.0.1")
    text = proxy_rules(domain, chosen, tls, store=place / "caddy", email=email)
    serve_folder(place, chosen, first_page, around=lambda: running_proxy(program, text, place / "caddy"))


def tls_lines(certificate: Path | None, key: Path | None, acme: str, acme_root: Path | None) -> Sequence[str]:
    """The lines by which Caddy learns where the certificate comes from; none for its own choice.

    Raises
    ------
    InputError
        One of certificate and key is missing, or a file is.
    """
    if (certificate is None) != (key is None):
        missing = "--key" if key is None else "--certificate"
        raise InputError(
            f"a certificate needs its key: expected --certificate and --key, {missing} is missing"
        )
    if acme_root is not None and not acme:
        raise InputError("--acme-root is the root of another authority: expected --acme URL with it")
    for file in (certificate, key, acme_root):
        if file is not None and not file.is_file():
            raise InputError(f"{file}: expected a PEM file, got none")
    if certificate is not None and key is not None:
        return [f"tls {_quoted(certificate)} {_quoted(key)}"]
    if not acme:
        return []
    trusted = [f"trusted_roots {_quoted(acme_root)}"] if acme_root else []
    return ["tls {", "issuer acme {", f"dir {acme}", *trusted, "}", "}"]


def check_certificate(certificate: Path, key: Path, domain: str) -> None:
    """Refuse a certificate that browsers would not accept; Caddy would silently ask for another.

    Raises
    ------
    InputError
        It is not readable, names other hosts, is out of date, or the key belongs to another certificate.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        first = x509.load_pem_x509_certificates(certificate.read_bytes())[0]
        names = first.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        hosts = [name.lower() for name in names.get_values_for_type(x509.DNSName)]
    except (OSError, ValueError, x509.ExtensionNotFound) as error:
        raise InputError(
            f"{certificate}: expected a PEM certificate with host names, got: {error}"
        ) from error
    # A wildcard stands for exactly one label (RFC 6125, section 6.4.3).
    if not {domain.lower(), f"*.{domain.lower().partition('.')[2]}"} & {*hosts}:
        raise InputError(f"{certificate} is for {', '.join(hosts) or 'no host'}; expected one for {domain}")
    today = datetime.now(UTC)
    if not first.not_valid_before_utc <= today <= first.not_valid_after_utc:
        ends, begins = first.not_valid_after_utc, first.not_valid_before_utc
        raise InputError(
            f"{certificate} is valid from {begins:%Y-%m-%d} to {ends:%Y-%m-%d}, which is not today"
        )
    try:
        own = load_pem_private_key(key.read_bytes(), password=None).public_key()
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{key}: expected a PEM private key without a password, got: {error}") from error
    if own != first.public_key():
        raise InputError(f"{key} is not the key of {certificate}; expected the key that belongs to it")


def proxy_rules(domain: str, port: int, tls: Sequence[str], *, store: Path, email: str = "") -> str:
    """Caddy's configuration: the rules of deploy/Caddyfile for this domain and this server.

    Parameters
    ----------
    domain : str
    port : int
        Where the server listens, on this machine only.
    tls : sequence of str
        See `tls_lines`.
    store : pathlib.Path
        Folder in which Caddy keeps certificates.
    email : str
        Address for the certificate authority; empty for none.
    """
    rules = next(path for path in RULES if path.is_file()).read_text(encoding="utf-8")
    general = ["admin off", f"storage file_system {_quoted(store)}", *([f"email {email}"] if email else [])]
    # The first brace opens the general options, `{$DOMAIN} {` the site.
    rules = rules.replace("\n{\n", "\n{\n" + "".join(f"\t{line}\n" for line in general), 1)
    rules = rules.replace("{$DOMAIN} {\n", f"{domain} {{\n" + "".join(f"\t{line}\n" for line in tls), 1)
    return rules.replace("server:8000", f"127.0.0.1:{port}")


@contextmanager
def running_proxy(program: str, rules: str, place: Path) -> Iterator[None]:
    """Run Caddy around the server; if Caddy ends first, the server is stopped.

    Raises
    ------
    InputError
        Caddy cannot start, for example because port 443 is in use.
    """
    place.mkdir(exist_ok=True, mode=0o700)
    (place / "Caddyfile").write_text(rules, encoding="utf-8")
    log = place / "caddy.log"
    command = [program, "run", "--config", str(place / "Caddyfile"), "--adapter", "caddyfile"]
    with log.open("wb") as stream:
        process = subprocess.Popen(  # noqa: S603 - found by its name
            command,
            stdout=stream,
            stderr=stream,
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        )
    # After its own shutdown, uvicorn raises the signal again: by default it would end Python on the spot.
    signal.signal(signal.SIGTERM, lambda number, _frame: sys.exit(128 + number))
    stopping, lost = threading.Event(), threading.Event()
    try:
        try:
            process.wait(SECONDS_TO_FAIL)
        except subprocess.TimeoutExpired:
            threading.Thread(target=_watch, args=(process, log, stopping, lost), daemon=True).start()
            yield
            if lost.is_set():
                raise InputError(f"Caddy ended: {last_error(log)}; the server stopped (log: {log})") from None
            return
        raise InputError(
            f"Caddy did not start: {last_error(log)}; ports 80 and 443 must be free and allowed for you "
            "(on Linux: sudo setcap cap_net_bind_service=+ep $(command -v caddy))"
        )
    finally:
        stopping.set()
        process.terminate()
        process.wait()


def last_error(log: Path) -> str:
    """The last error that Caddy wrote, without its line's other fields; empty if there is none."""
    reason = ""
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith(("Error: ", "run: ")):
            reason = line.partition(": ")[2]
        elif line.startswith("{") and line.endswith("}") and '"level":"error"' in line:
            entry = json.loads(line)  # the last line may be half-written
            reason = str(entry.get("error") or entry.get("msg") or "")
    return " ".join(reason.split())[:300]


def _watch(
    process: subprocess.Popen[bytes], log: Path, stopping: threading.Event, lost: threading.Event
) -> None:
    """Print once that there is a certificate, or why there is none yet; stop the server if Caddy ends."""
    printed = ""
    while process.poll() is None:
        time.sleep(1)
        if OBTAINED in log.read_text(encoding="utf-8", errors="replace"):
            typer.echo("Caddy got the certificate.")
            process.wait()
        elif (error := last_error(log)) and error != printed:
            typer.echo(f"Caddy reports: {error} (log: {log})")
            printed = error
    # Ctrl-C ends Caddy too, a moment before the server has stopped.
    if not stopping.wait(0 if process.returncode else SECONDS_AFTER_CTRL_C):
        lost.set()
        _thread.interrupt_main()


def _end_with_parent() -> None:
    """Ask Linux to end this process with its parent, even if that is killed."""
    import ctypes

    set_signal_at_parents_end = 1  # PR_SET_PDEATHSIG of <sys/prctl.h>
    ctypes.CDLL(None).prctl(set_signal_at_parents_end, signal.SIGTERM)


def _caddy() -> str:
    program = shutil.which("caddy")
    if program is None:
        raise InputError(
            "https needs the program caddy, and it was not found; install it (Debian: sudo apt install "
            "caddy, macOS: brew install caddy, Windows: winget install CaddyServer.Caddy)"
        )
    return program


def check_name(domain: str, *, is_public: bool) -> None:
    """Refuse what is not a host name.

    Raises
    ------
    InputError
        It is none, or a public one has no dot.
    """
    is_address = domain.replace(".", "").isdigit()
    if not NAME.fullmatch(domain) or is_address or (is_public and "." not in domain):
        raise InputError(f"--domain: expected a host name such as lab.example.org, got '{domain}'")


def _quoted(path: Path | None) -> str:
    # Caddy knows no escapes but that of the quote: letters and slashes stay as they are.
    return json.dumps(path.resolve().as_posix() if path else "", ensure_ascii=False)
