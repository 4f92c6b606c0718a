"""`palpebra` and `palpebra demo`: the server with the embedded default, and the browser on the first page."""

import math
import os
import shlex
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote, urlencode

import typer

from experiments.errors import InputError
from palpebra.folders import DATA_VARIABLE, PORT, Folder, data_folder, default_folder, free_port, use_folder

if TYPE_CHECKING:  # the server is only imported when it starts, so that `palpebra --help` is quick
    from server.cli_run import StudyLink, Welcome

DEMO = Path(__file__).resolve().parent / "demo"
"""The demo's declaration and clips; `make wheel` builds them."""
DEMO_NAME = "demo"
DEMOS = (DEMO_NAME, "exp3")
"""Studies that the first page offers to try: that of the package, or that of `make run`."""
LOCK = "palpebra.lock"

Page = Callable[["Welcome", Path], str]
"""From the links and the data folder to the path that the browser opens."""
Port = Annotated[
    int | None, typer.Option(min=1, max=65535, help="Port; by default the first free one from 8000 on.")
]
NoBrowser = Annotated[bool, typer.Option("--no-browser", help="Print the address and open no browser.")]


def register(parent: typer.Typer) -> None:
    """Add the commands that start the server."""
    parent.command("start")(start)
    parent.command("demo")(demo)


def start(folder: Folder = None, port: Port = None, no_browser: NoBrowser = False) -> None:
    """Start the server and open the first page. This is what `palpebra` alone does.

    The first start creates the database and adds the demo study. On the page you try the demo, make a study
    from your clips, or analyze data. Stop with Ctrl-C.

    Examples:

        palpebra

        palpebra --folder ~/studies --port 8010 --no-browser
    """
    _serve(folder, port, first_page, with_browser=not no_browser)


def demo(folder: Folder = None, port: Port = None, no_browser: NoBrowser = False) -> None:
    """Add the demo study, start the server and open the study as a participant.

    Example: palpebra demo
    """
    _serve(folder, port, demo_page, with_browser=not no_browser)


def first_page(welcome: "Welcome", folder: Path) -> str:
    """Path of the first page, with what it needs to know after the `#`, which no server sees.

    Parameters
    ----------
    welcome : Welcome
        Links of open studies, and the invitation for the first account.
    folder : Path
        The data folder; the page names it.
    """
    known = {"folder": str(folder)}
    if link := demo_link(welcome):
        known |= {"demo": link.path, "minutes": str(max(1, math.ceil(link.minutes)))}
    if welcome.invitation:
        known["invitation"] = welcome.invitation
    return f"/admin/start#{urlencode(known, quote_via=quote)}"


def demo_page(welcome: "Welcome", folder: Path) -> str:
    """Path of the demo study's participant page.

    Raises
    ------
    InputError
        The demo study was removed.
    """
    link = demo_link(welcome)
    if link is None:
        raise InputError(f"the demo study was removed from {folder}; choose another folder by --folder")
    return link.path


def demo_link(welcome: "Welcome") -> "StudyLink | None":
    """The demo's link for participants, the short one first; None if this server has no demo."""
    links = {link.study: link for link in welcome.links}
    return next((links[name] for name in DEMOS if name in links), None)


def _serve(folder: Path | None, port: int | None, page: Page, *, with_browser: bool) -> None:
    place = data_folder(folder)
    chosen = free_port(port)
    if port is None and chosen != PORT:
        typer.echo(f"Port {PORT} is in use; using {chosen}.")
    os.environ.setdefault("PALPEBRA_PUBLIC_URL", f"http://localhost:{chosen}")
    serve_folder(place, chosen, page, with_browser=with_browser)


def serve_folder(
    place: Path,
    port: int,
    page: Page,
    *,
    with_browser: bool = False,
    around: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> None:
    """Prepare the data folder, serve until stopped, and print where to go as soon as the server answers.

    Parameters
    ----------
    place : pathlib.Path
        The data folder.
    port : int
        A free port.
    page : callable
        The path of the page to open, from the links and the data folder.
    with_browser : bool
        Whether to open that page.
    around : callable
        Returns what runs while the server runs, such as a proxy.
    """
    use_folder(place)
    from server.cli_common import stored_services
    from server.cli_run import make_welcome, print_links, serve

    with only_server_of(place):
        _prepare(place)
        with stored_services() as services:
            welcome, public_url = make_welcome(services), services.settings.public_url
        # A browser on this machine; under a domain, the address that everybody uses.
        local = public_url if public_url.startswith("https://") else f"http://localhost:{port}"
        address = local + page(welcome, place)
        typer.echo(f"Data folder: {place}")
        if place != default_folder():
            typer.echo(f"For commands on these data: export {DATA_VARIABLE}={shlex.quote(str(place))}")

        def say_where() -> None:
            print_links(welcome, public_url)
            # On a line alone, so that it can be copied, with room to the log that follows.
            typer.secho(f"\nOpen {address}\n", bold=True)
            typer.echo("Stop with Ctrl-C.")
            if with_browser and not (os.environ.get("BROWSER") == "none" or webbrowser.open(address)):
                typer.echo(f"No browser was found. Open {address} yourself.")

        with around():
            serve("127.0.0.1", port, announce=lambda _: say_where)


def _prepare(place: Path) -> None:
    """Create or upgrade the database, and add the demo study to a new one."""
    from server.cli_common import migrated_services

    is_new = not (os.environ.get("DATABASE_URL") or (place / "palpebra.sqlite").exists())
    with migrated_services():
        pass
    if is_new and not (DEMO / "manifest.json").is_file():
        typer.echo("There is no demo study here; `make wheel` builds it.")
    elif is_new:
        from server.studies.cli import add

        add(str(DEMO / "demo.toml"), DEMO, name=DEMO_NAME, open_=True, link=False)


@contextmanager
def only_server_of(place: Path) -> Iterator[None]:
    """Hold the folder while its server runs.

    Raises
    ------
    InputError
        Another `palpebra` serves this folder.
    """
    from server.core.locks import file_lock

    try:
        with file_lock(place / LOCK, wait=False):
            yield
    except BlockingIOError as error:
        raise InputError(
            f"another palpebra is serving {place}; stop it, or choose another folder by --folder"
        ) from error
