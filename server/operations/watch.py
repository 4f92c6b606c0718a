"""Studies that are watched: what goes wrong with one is shown on its page and sent to its owners once."""

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import AbstractAsyncContextManager, suppress
from datetime import timedelta
from typing import Any, Literal, NamedTuple

import httpx2
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import OPERATOR, Identity
from server.accounts.letters import can_send, send_mail
from server.core.changes import Stopped, background_task
from server.core.db import Database
from server.core.locks import Locks, LockTaken
from server.core.settings import Settings
from server.core.values import now
from server.models import STAGES, Study
from server.operations import repository
from server.operations.doctor import Finding
from server.participation.run_schemas import Origin
from server.results import monitor_repository
from server.results.monitor import LATEST_RUNS, failing_clips, stage_reached
from server.studies.lookup import active_definition, find_study

LOG = logging.getLogger(__name__)
FIRST_LOOK_S, LOOK_EVERY_S = 60.0, 600.0
WEBHOOK_S = 10.0

LEFT_AT_LEAST, LEFT_SHARE = 3, 0.3
"""Drop-outs at one page: fewer people, or a smaller part of those who reached it, happen in every study."""
FLAGGED_SHARE, PLAYS_AT_LEAST = 0.2, 50
QUOTA_SHARE = 0.9
_ACTION = "warning sent"


class StudyWarning(BaseModel):
    """Something about a study with participants that needs its owners."""

    kind: Literal["clip", "drop_outs", "plays", "quota", "server"]
    event: str = Field(description="Identifies the event, which is sent once.")
    text: str = Field(description="What happened and what to do.")
    page: Literal["clips", "monitor", "settings", "server"]


def study_warnings(session: Session, study: Study, of_server: Sequence[Finding]) -> list[StudyWarning]:
    """What goes wrong with a study that is open; nothing where it is not. The doctor found `of_server`."""
    if study.status not in ("pilot", "live"):
        return []
    origin: Origin = "pilot" if study.status == "pilot" else "participant"
    runs = monitor_repository.latest_runs(session, study, origin, LATEST_RUNS)
    lease = timedelta(minutes=active_definition(session, study).session.lease_minutes)
    # A new version is a new event: what was sent of the version before says nothing about it.
    version = f"version {study.active_version}"
    return [
        *_of_clips(session, study, origin, version),
        *_drop_outs(runs, lease, version),
        *_flagged_plays(runs, version),
        *_quota(session, study, origin),
        *_of_server(of_server),
    ]


def _of_clips(session: Session, study: Study, origin: Origin, version: str) -> Iterator[StudyWarning]:
    for clip in failing_clips(session, study, origin):
        if clip.alarm:
            text = f"The clip {clip.file} could not be shown to {clip.failed_for} of {clip.people} people."
            todo = "Pause the study, play the clip under Clips, and replace it."
            event = f"clip {clip.clip_sha256} of {version}"
            yield StudyWarning(kind="clip", event=event, text=f"{text} {todo}", page="clips")


def _drop_outs(runs: Sequence[Any], lease: timedelta, version: str) -> Iterator[StudyWarning]:
    """Pages that many people did not get past: silent for longer than the lease, or withdrawn there."""
    moment = now()
    reached, left = Counter[int](), Counter[int]()
    for run in runs:
        stage = STAGES.index(stage_reached(run))
        reached.update(range(stage + 1))
        silent = run.status == "active" and moment - run.last_seen_at > lease
        left[stage] += silent or run.status == "withdrawn"
    for stage, name in enumerate(STAGES):
        if left[stage] >= LEFT_AT_LEAST and left[stage] >= LEFT_SHARE * reached[stage]:
            people = f"{left[stage]} of {reached[stage]} people who reached the page"
            text = f"{people} '{name.replace('_', ' ')}' left the study there."
            todo = "Preview the study up to this page, and shorten or explain it."
            event = f"drop-outs at {name} of {version}"
            yield StudyWarning(kind="drop_outs", event=event, text=f"{text} {todo}", page="monitor")


def _flagged_plays(runs: Sequence[Any], version: str) -> Iterator[StudyWarning]:
    letters = Counter("".join(run.heat for run in runs))
    plays = letters.total() - letters["."]
    bad = letters["f"] + letters["x"]
    if plays >= PLAYS_AT_LEAST and bad > FLAGGED_SHARE * plays:
        text = f"{bad} of {plays} clips were shown with flaws ({100 * bad / plays:.0f}%)."
        todo = "See the reasons under Results, How clips were shown."
        yield StudyWarning(
            kind="plays", event=f"flagged plays of {version}", text=f"{text} {todo}", page="monitor"
        )


def _quota(session: Session, study: Study, origin: Origin) -> Iterator[StudyWarning]:
    if study.quota is None:
        return
    counts = monitor_repository.run_counts(session, study)
    complete = sum(one.runs for one in counts if one.origin == origin and one.status == "complete")
    if QUOTA_SHARE * study.quota <= complete:
        full = complete >= study.quota
        text = f"{complete} of {study.quota} runs are complete" + (
            ": the study is full, and nobody else can begin." if full else "."
        )
        todo = "Raise the limit under Settings if you need more." if not full else "Close the study."
        event = f"quota {study.quota} {'full' if full else 'nearly full'}"
        yield StudyWarning(kind="quota", event=event, text=f"{text} {todo}", page="settings")


_FAULTS = ("data folder", "shared folder", "backups")


def _of_server(findings: Sequence[Finding]) -> Iterator[StudyWarning]:
    for finding in findings:
        if finding.subject in _FAULTS and finding.verdict != "ok":
            year, week, _ = now().isocalendar()
            text = f"The server needs attention ({finding.subject}). Ask its operator to run `server doctor`."
            event = f"server {finding.subject} in week {week} of {year}"
            yield StudyWarning(kind="server", event=event, text=text, page="server")


Examine = Callable[[], Sequence[Finding]]
"""Asks the doctor (`server.operations.doctor.findings_for_studies`)."""


def warnings_shown(database: Database, examine: Examine, name: str, identity: Identity) -> list[StudyWarning]:
    """The warnings on a study's page. The doctor is asked only for accounts that may see the study."""
    with database.read() as session:
        study = find_study(session, name, identity, "view")
        if study.status not in ("pilot", "live"):
            return []
        return study_warnings(session, study, examine())


# The look that the server takes by itself, and what it sends.


class WatchedServer(NamedTuple):
    """What a look at all studies uses of the running server."""

    settings: Settings
    database: Database
    locks: Locks
    examine: Examine


def studies_watched(
    server: WatchedServer, first_look_s: float = FIRST_LOOK_S
) -> AbstractAsyncContextManager[None]:
    """Look at every open study each ten minutes while the server runs; one process at a time."""
    return background_task(lambda stopped: _watch(server, first_look_s, stopped))


async def _watch(server: WatchedServer, first_look_s: float, stopped: Stopped) -> None:
    await asyncio.sleep(first_look_s)
    while True:
        try:
            await asyncio.to_thread(look_at_studies, server, stopped)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("watching studies")
        await asyncio.sleep(LOOK_EVERY_S)


def look_at_studies(server: WatchedServer, stopped: Stopped = lambda: False) -> None:
    """Send what is new of every open study to its owners, unless another process is at it."""
    settings = server.settings
    if not can_send(settings) and not settings.webhook_url:
        return
    with suppress(LockTaken), server.locks.held("watching studies"):
        findings = server.examine()
        with server.database.read() as session:
            names = repository.open_study_names(session)
        for name in names:
            if stopped():
                return
            try:
                _send_new(server, name, findings)
            except Exception:  # the other studies are watched, whatever went wrong with this one
                LOG.exception("watching the study %s", name)


def _send_new(server: WatchedServer, name: str, findings: Sequence[Finding]) -> None:
    with server.database.read() as session:
        study = find_study(session, name, OPERATOR, "view")
        arrived = repository.ways_recorded(session, _ACTION, name)
        warnings = list(study_warnings(session, study, findings))
        title, addresses = study.title, repository.owner_addresses(session, study)
        keys = {one.event: _key(study, one) for one in warnings}
    for warning in warnings:
        event = keys[warning.event]
        by = _send(server.settings, name, title, warning, addresses, arrived.get(event, set()))
        if not by:  # known already, or no way works: the next look tries again
            continue
        with server.database.write() as session:
            record(session, OPERATOR, _ACTION, "study", name, event=event, by=by)


def _key(study: Study, warning: StudyWarning) -> str:
    """A study that is made again under an old name has its own events."""
    return f"{study.id}: {warning.event}"


def _send(
    settings: Settings,
    name: str,
    title: str,
    warning: StudyWarning,
    addresses: Sequence[str],
    arrived: Set[str],
) -> list[str]:
    """By which ways it arrived now, and not before: one that fails keeps none of the others from it."""
    link = f"{settings.public_url}/admin/studies/{name}/{warning.page}".removesuffix("/server")
    text = (
        f"{warning.text}\n\n{link}\n\nYou receive this email because you own the study '{title}'. "
        "Each event is sent once.\n"
    )
    by = []
    if can_send(settings) and "mail" not in arrived:
        sent = [send_mail(settings, one, f"Palpebra: {title}", text) for one in addresses]
        by += ["mail"] if any(sent) else []
    if settings.webhook_url and "webhook" not in arrived:
        content = {"study": name, "title": title, "kind": warning.kind, "text": warning.text, "link": link}
        by += ["webhook"] if _call_webhook(settings.webhook_url, content) else []
    return by


def _call_webhook(address: str, content: dict[str, str]) -> bool:
    """Whether the webhook took it; else one line in the log says why, without the address, a secret."""
    try:
        # Its answer is not read: one that never ends holds nothing up.
        with httpx2.stream("POST", address, json=content, timeout=WEBHOOK_S) as answer:
            if answer.is_success:
                return True
            LOG.error("the webhook refused a warning: expected status 2xx, got %d", answer.status_code)
    except httpx2.TimeoutException:
        LOG.error("the webhook did not answer within %g s; check PALPEBRA_WEBHOOK_URL", WEBHOOK_S)
    except (httpx2.HTTPError, httpx2.InvalidURL, ValueError, OSError) as error:
        LOG.error("the webhook cannot be reached (%s); check PALPEBRA_WEBHOOK_URL", type(error).__name__)
    return False
