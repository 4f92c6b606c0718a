"""`server run`: serve participants and experimenters."""

import os
import shutil
import socket
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Annotated, NamedTuple

import typer
import uvicorn

from experiments.errors import InputError
from experiments.kinds import expected_minutes
from server.accounts import invitations
from server.accounts import service as accounts
from server.accounts.endpoints import invitation_url
from server.cli_common import migrated_services, out
from server.context import Services
from server.core.logs import logging_configuration
from server.core.settings import ADDRESS_FILE, Settings
from server.core.storage import close_to_others
from server.operations.doctor import late_entry
from server.operations.metrics import MULTIPROCESS_VARIABLE
from server.privacy.ledger import begin_ledger
from server.protocol import BoundedHttp
from server.studies.links import general_links, link_url
from server.studies.lookup import active_definition
from server.studies.repository import open_studies

GRACE_S = 20
WORKER_START_S = 60
"""A worker silent for so long is replaced; on a busy machine starting alone takes more than the usual 5 s."""
PUBLIC_URL = "PALPEBRA_PUBLIC_URL"
TRUSTED_PROXIES = "FORWARDED_ALLOW_IPS"
"""Addresses of proxies whose X-Forwarded-For is believed; uvicorn reads it. None are without it."""
KEEP_ALIVE_S = 75
"""Longer than a trial lasts, so that a rater keeps one connection, and than proxies keep theirs idle."""


def register(parent: typer.Typer) -> None:
    """Add `server run` to the command line."""
    parent.command("run")(run)


def run(
    host: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0 for all.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port to listen on.")] = 8000,
    workers: Annotated[
        int, typer.Option(min=1, max=64, help="Number of processes; more than one requires PostgreSQL.")
    ] = 1,
    welcome: Annotated[
        bool | None,
        typer.Option(
            "--welcome/--no-welcome",
            help="Print the links of open studies and of the admin site. Default: in a terminal only; a log "
            "should not hold them.",
        ),
    ] = None,
) -> None:
    """Serve participants and experimenters until stopped (Ctrl-C); running requests are finished first.

    Settings come from the environment, see docs/reference/settings.md. Behind an https proxy, set
    PALPEBRA_PUBLIC_URL.
    Example: server run --host 0.0.0.0 --port 8000 --workers 2
    """
    is_shown = sys.stdout.isatty() if welcome is None else welcome
    serve(host, port, workers, _welcome if is_shown else None)


Announce = Callable[[Services], Callable[[], None]]
"""Prepares what to print, before the server starts; what it returns prints it."""


def serve(host: str, port: int, workers: int = 1, announce: Announce | None = None) -> None:
    """Serve until stopped; what `announce` prepares is printed once the server answers.

    Links that are printed earlier lead to an error page.
    """
    _check_free(host, port)
    # For this process and its workers; else they would take the URL of the start before.
    os.environ.setdefault(PUBLIC_URL, f"http://localhost:{port}")
    settings = Settings()
    note_address(settings)
    with migrated_services(settings) as services:
        _check_clock(services)
        close_to_others(settings)
        begin_ledger(settings)
        services.settings.key  # noqa: B018 - made now, once, before workers ask for it
        said = announce(services) if announce else None
    if said is not None:
        Thread(target=_call_when_ready, args=(host, port, said), daemon=True).start()
    # No access log: it would write every participant's internet address.
    with _shared_counts(workers):
        uvicorn.run(
            "server.app:create_lasting_app",
            factory=True,
            http=BoundedHttp,
            host=host,
            port=port,
            workers=workers,
            access_log=False,
            server_header=False,
            log_config=logging_configuration(settings),
            timeout_graceful_shutdown=GRACE_S,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_worker_healthcheck=WORKER_START_S,
            # uvicorn by itself believes what anybody on this machine says of the sender's address.
            proxy_headers=TRUSTED_PROXIES in os.environ,
        )


def note_address(settings: Settings) -> None:
    """Store the server's URL in its data folder, for the links that commands print."""
    settings.data_folder.mkdir(parents=True, exist_ok=True)
    (settings.data_folder / ADDRESS_FILE).write_text(f"{settings.public_url}\n", encoding="utf-8")


@contextmanager
def _shared_counts(workers: int) -> Iterator[None]:
    """Several workers count into files of one folder, so that any of them can report the sum."""
    if workers == 1 or MULTIPROCESS_VARIABLE in os.environ:
        yield
        return
    folder = tempfile.mkdtemp(prefix="palpebra-metrics-")
    os.environ[MULTIPROCESS_VARIABLE] = folder
    try:
        yield
    finally:
        del os.environ[MULTIPROCESS_VARIABLE]
        shutil.rmtree(folder, ignore_errors=True)


def why_not_free(host: str, port: int) -> OSError | None:
    """Why nothing can listen on a port; None if it is free."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            return error
    return None


def _check_free(host: str, port: int) -> None:
    error = why_not_free(host, port)
    if error is None:
        return
    reason = error.strerror or str(error)
    if isinstance(error, socket.gaierror):
        raise InputError(
            f"cannot listen on '{host}' ({reason}); choose another address with --host"
        ) from error
    raise InputError(
        f"cannot listen on {host}:{port} ({reason}); "
        "choose another port with --port (with make: PORT=8001 make run)"
    ) from error


def _check_clock(services: Services) -> None:
    late = late_entry(services)
    if late and not services.settings.ignore_clock:
        raise InputError(f"{late}; set the clock (if that entry is wrong: PALPEBRA_IGNORE_CLOCK=true)")


class StudyLink(NamedTuple):
    """The path of an open study's link for participants."""

    study: str
    status: str
    group: str | None
    path: str
    minutes: float
    """How long taking part is expected to take."""


class Welcome(NamedTuple):
    """Where to go once the server runs."""

    links: list[StudyLink]
    invitation: str | None
    """Token that creates the first account; None once there is an account."""


def make_welcome(services: Services) -> Welcome:
    """The links of open studies, and an invitation for the first owner while there is no account."""
    key = services.settings.key
    with services.database.write() as session:
        links = [
            StudyLink(study.name, study.status, link.group_name, link_url("", key, link.public_id), minutes)
            for study in open_studies(session)
            for minutes in [expected_minutes(active_definition(session, study))]
            for link in general_links(session, key, study)
        ]
        is_first = not accounts.accounts_exist(session)
    invite = invitations.invite(services.database, "owner", "first owner", None)[1] if is_first else None
    return Welcome(links, invite)


def print_links(welcome: Welcome, public_url: str) -> None:
    """Print the participant links of open studies."""
    for link in welcome.links:
        group = f", {link.group}" if link.group else ""
        out.print(f"{link.study} ({link.status}{group}): {public_url}{link.path}")


def _welcome(services: Services) -> Callable[[], None]:
    """What `server run` prints: the links of open studies and of the admin site."""
    welcome, public_url = make_welcome(services), services.settings.public_url

    def print_welcome() -> None:
        print_links(welcome, public_url)
        out.print(f"admin site: {public_url}/admin/")
        if welcome.invitation:
            url = invitation_url(public_url, welcome.invitation)
            out.print(f"create the first account (link works once): {url}")

    return print_welcome


def _call_when_ready(host: str, port: int, action: Callable[[], None]) -> None:
    # All addresses of this machine include the loopback one; nothing can be sent to 0.0.0.0 or :: itself.
    reached = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 - nothing is bound here
    address = f"[{reached}]" if ":" in reached else reached
    # Without the proxy of the environment, which cannot reach this machine's own server.
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while True:
        try:
            direct.open(f"http://{address}:{port}/healthz", timeout=2).close()
        except OSError:
            time.sleep(0.2)
            continue
        return action()
