"""`server simulate`: simulated participants through the real API; their runs have the origin `simulated`."""

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from experiments.errors import InputError, counted
from server.app import create_app
from server.cli_common import out, stored_services
from server.core.settings import Settings
from server.rehearsals.http import JsonClient, RefusedRequest, running_server
from server.rehearsals.manners import MANNERS, act, manner_called, summary, write
from server.rehearsals.person import (
    FAILED_SHARE,
    FLAGGED_SHARE,
    SEES_MOTION,
    Person,
    Rater,
    link_and_raters,
)


def register(parent: typer.Typer) -> None:
    """Add `server simulate` to the command line."""
    parent.command("simulate")(simulate)


def simulate(
    study: Annotated[str, typer.Argument(help="Name of a study, including drafts and closed studies.")],
    participants: Annotated[int, typer.Option(min=1, max=100_000, help="How many.")] = 3,
    seed: Annotated[
        int, typer.Option(help="Random seed of the simulated people and the effects in their answers.")
    ] = 1,
    at_once: Annotated[
        int, typer.Option(min=1, max=200, help="Number of people who take part at the same time.")
    ] = 2,
    url: Annotated[str, typer.Option(help="URL of a running server; by default, one is started.")] = "",
    manner: Annotated[
        str,
        typer.Option("--as", help=f"Simulated behavior, to test the evidence checks: {', '.join(MANNERS)}."),
    ] = "",
    observer: Annotated[
        str,
        typer.Option(
            help="In a study of thresholds, the true function, for example threshold=200,spread=30. Keys: "
            "threshold, spread, sd (of people's thresholds), guess, lapse and, with a second factor, tilt. "
            "Omitted values are typical for the stimuli."
        ),
    ] = "",
    json_file: Annotated[
        Path | None,
        typer.Option("--json", help="With --as: output file for the verdict and signals of each run."),
    ] = None,
) -> None:
    """Run simulated participants through the HTTP API; their runs have the origin `simulated`.

    Counts, quotas, results and reports of people's answers never include them, so you can rehearse a draft.

    Each completes consent, forms, calibration and every trial. Answers follow a rater model with effects
    drawn by the seed, so that an analysis has something to find; they say nothing about people.
    With --as they pass the same checks as people, and the verdict on each run is printed.

    Examples:

      server simulate exp3 --participants 20

      server simulate exp3 --as http --participants 5 --json http.json

      server simulate threshold_demo --participants 10 --observer threshold=180,spread=30,sd=15
    """
    settings = Settings()
    if manner:
        if url:
            raise InputError("--as starts a separate server whose clock it controls; remove --url")
        _simulate_manner(
            settings,
            study,
            manner,
            range(seed * 1_000_000, seed * 1_000_000 + participants),
            at_once,
            json_file,
        )
        return
    if json_file is not None:
        raise InputError("--json requires --as, which produces the verdicts")
    with stored_services(settings) as services:
        token, raters = link_and_raters(
            services.database, services.settings, services.versions, study, observer
        )
    people = range(seed * 1_000_000, seed * 1_000_000 + participants)
    with (
        _server(settings, url) as address,
        ThreadPoolExecutor(at_once) as pool,
        _bar(participants) as advance,
    ):
        work = [pool.submit(_take_part, address, token, raters(number, seed)) for number in people]
        ratings = 0
        for done in as_completed(work):
            try:
                ratings += done.result()
            except RefusedRequest as error:
                pool.shutdown(wait=False, cancel_futures=True)
                raise InputError(f"the server refused a simulated participant: {error}") from error
            advance()
    out.print(
        f"study {study}: {counted(participants, 'simulated participant')}, {counted(ratings, 'rating')}, "
        "practice and repeated plays included"
    )
    out.print(
        f"As happens with people, {FAILED_SHARE:.0%} of plays fail and are repeated, {FLAGGED_SHARE:.0%} are "
        f"flagged, and {1 - SEES_MOTION:.0%} of motion checks are guessed. This is by design, so that "
        "exclusions are rehearsed too."
    )


def _simulate_manner(
    settings: Settings, study: str, name: str, people: range, at_once: int, json_file: Path | None
) -> None:
    """Simulated people in a manner, with the verdict on each."""
    manner = manner_called(name)
    with stored_services(settings) as services:
        token, raters = link_and_raters(services.database, services.settings, services.versions, study)
    everyone = [raters(number, people.start) for number in people]
    runs = act(settings, token, everyone, manner, at_once)
    if json_file is not None:
        write(json_file, study, name, runs)
    out.print(f"study {study}, {len(runs)} as {name}: {summary(runs)}")
    if name in ("honest", "assistive"):
        out.print(f"'{name}' stands for people: likely is the right verdict.")
    else:
        out.print(f"'{name}' is made to fail the checks: with any verdict but likely, they have caught it.")


def _take_part(address: str, token: str, rater: Rater) -> int:
    client = JsonClient(address)
    try:
        person = Person(client, rater)
        person.take_part(token)
        return person.ratings
    finally:
        client.close()


@contextmanager
def _server(settings: Settings, url: str) -> Iterator[str]:
    if url:
        yield url
        return
    with running_server(create_app(settings)) as address:
        yield address


@contextmanager
def _bar(total: int) -> Iterator[Callable[[], None]]:
    """A progress bar with remaining time on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    columns = (
        TextColumn("participants", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True, markup=False)) as progress:
        task = progress.add_task("participants", total=total)
        yield lambda: progress.advance(task)
