"""The periods of `[retention]`, carried out each hour: what is due, and its erasure."""

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

from pydantic import BaseModel, Field
from sqlalchemy import Select
from sqlalchemy.orm import Session

from experiments.declaration.tables import Retention
from server.accounts.audit import record
from server.core.changes import Stopped, background_task
from server.core.db import Database
from server.core.locks import Locks, LockTaken
from server.core.settings import Settings
from server.core.values import now
from server.models import Study, StudyRun, StudyVersion
from server.privacy import repository
from server.privacy.erasures import forget, forget_identifiers
from server.privacy.ledger import note_erased, note_identifiers_erased
from server.studies.lookup import definition_of

# What is erased by the declared periods, as pages and the command line show it.

What = Literal["identifiers", "unfinished", "answers"]


class Period(BaseModel):
    """One declared period of a study."""

    what: What = Field(description="Who took part; unfinished visits as a whole; every visit as a whole.")
    days: int = Field(description="After a visit's last sign of life; of the version that new runs use.")


class RetentionPreview(BaseModel):
    """What would be erased at this moment, and when something is due next."""

    study: str
    periods: list[Period] = Field(description="As the version declares them that new runs use.")
    identifiers: int = Field(description="Visits whose identifiers are due.")
    visits: int = Field(description="Visits that are due as a whole.")
    next_at: datetime | None = Field(description="When more is due; null where nothing is on its way.")


# The periods of `[retention]`, carried out: what is due, and its erasure a few visits at a time.

LOG = logging.getLogger(__name__)
AT_ONCE = 20
"""Visits erased in one transaction: raters wait for it on SQLite."""
MAX_REST_S = 2.0


@dataclass(frozen=True)
class Rule:
    """One period and the visits of one version that it is for."""

    what: What
    days: int
    visits: Select[StudyRun]

    def limit(self, moment: datetime) -> datetime:
        """Whose last sign of life was before is due."""
        return moment - timedelta(days=self.days)


@dataclass(frozen=True)
class ErasureCounts:
    """What was erased of a study: visits of which it was erased who took part, and visits as a whole."""

    study: str
    identifiers: int
    visits: int


def preview(session: Session, study: Study, moment: datetime) -> RetentionPreview:
    """What is due, and when something is next."""
    rules = list(_rules(session, study))
    whole = _due_visits(session, (rule for rule in rules if rule.what != "identifiers"), moment)
    known = _due_visits(session, (rule for rule in rules if rule.what == "identifiers"), moment)
    return RetentionPreview(
        study=study.name,
        periods=_periods(_active(session, study)),
        identifiers=len(known - whole),
        visits=len(whole),
        next_at=_next_due(session, rules, moment),
    )


def _due_visits(session: Session, rules: Iterable[Rule], moment: datetime) -> set[int]:
    """The visits that are due by any of the rules."""
    due = (repository.numbers_due(session, rule.visits, rule.limit(moment)) for rule in rules)
    return set[int]().union(*due)


def _next_due(session: Session, rules: list[Rule], moment: datetime) -> datetime | None:
    coming = (
        (repository.first_seen_after(session, rule.visits, rule.limit(moment)), rule.days) for rule in rules
    )
    return min((seen + timedelta(days=days) for seen, days in coming if seen is not None), default=None)


def _rules(session: Session, study: Study) -> Iterator[Rule]:
    """The rules of every version of a study; visits as a whole come first."""
    active = _active(session, study)
    for version in repository.study_versions(session, study):
        periods = definition_of(version).retention.shorter(active)
        if periods.answers_days is not None:
            yield Rule("answers", periods.answers_days, repository.kept_visits(version, unfinished=False))
        if periods.unfinished_days is not None:
            yield Rule(
                "unfinished", periods.unfinished_days, repository.kept_visits(version, unfinished=True)
            )
        if periods.identifiers_days is not None:
            yield Rule("identifiers", periods.identifiers_days, repository.identified_visits(version))


def _active(session: Session, study: Study) -> Retention:
    versions: dict[int, StudyVersion] = {one.number: one for one in repository.study_versions(session, study)}
    return definition_of(versions[study.active_version]).retention


def _periods(declared: Retention) -> list[Period]:
    days: dict[What, int | None] = {
        "identifiers": declared.identifiers_days,
        "unfinished": declared.unfinished_days,
        "answers": declared.answers_days,
    }
    return [Period(what=what, days=number) for what, number in days.items() if number is not None]


# Decision 0741: The server enforces the declared retention.
def carry_out(
    database: Database, settings: Settings, study: str, stopped: Callable[[], bool] = lambda: False
) -> ErasureCounts:
    """Erase what is due of a study, a few visits at a time so that raters are not held up.

    Parameters
    ----------
    study : str
        Its name.
    stopped : callable
        Asked between two transactions; once true no further one begins.
    """
    done: dict[What, int] = {"identifiers": 0, "unfinished": 0, "answers": 0}
    while not stopped():
        began = time.monotonic()
        with database.write() as session:
            erased = _batch(session, settings, study)
        if erased is None:
            break
        what, number = erased
        done[what] += number
        # Raters who waited on SQLite come in between.
        time.sleep(min(time.monotonic() - began, MAX_REST_S))
    return ErasureCounts(study, done["identifiers"], done["unfinished"] + done["answers"])


def _batch(session: Session, settings: Settings, name: str) -> tuple[What, int] | None:
    """Erase the first few visits that are due; None where none is."""
    study = repository.study_called(session, name)
    moment = now()
    for rule in _rules(session, study) if study is not None else ():
        runs = repository.visits_held(session, rule.visits, rule.limit(moment), AT_ONCE)
        if runs and study is not None:
            _erase(session, settings, study, rule, runs)
            return rule.what, len(runs)
    return None


def _erase(session: Session, settings: Settings, study: Study, rule: Rule, runs: list[StudyRun]) -> None:
    """As on request: the ledger is written before the database is committed."""
    action = "identifiers erased" if rule.what == "identifiers" else "run erased"
    for run in runs:
        if rule.what == "identifiers":
            forget_identifiers(session, run)
        else:
            forget(session, run)
        record(session, None, action, "run", run.public_id, study=study.name, retention_days=rule.days)
    session.flush()
    ids = [run.public_id for run in runs]
    if rule.what == "identifiers":
        note_identifiers_erased(settings, ids)
    else:
        note_erased(settings, ids)


def studies_with_period(session: Session) -> list[str]:
    """The studies of which any version declares a period."""
    return [study.name for study in repository.every_study(session) if _declares_period(session, study)]


def _declares_period(session: Session, study: Study) -> bool:
    """Whether a study declares a period; one that cannot be read is reported and skipped."""
    try:
        return next(_rules(session, study), None) is not None
    except Exception:  # of one study: the others keep to what they declare
        LOG.exception("retention of %s", study.name)
        return False


# The hourly erasure that the server makes by itself.

FIRST_LOOK_S, LOOK_EVERY_S = 120.0, 3600.0
DRAFTS_FOR = timedelta(days=90)
"""Unsaved work of the builder that nobody changed for so long is deleted."""


def hourly_retention(
    database: Database, settings: Settings, locks: Locks, first_look_s: float = FIRST_LOOK_S
) -> AbstractAsyncContextManager[None]:
    """Carry out the periods of every study each hour while the server runs; one process at a time."""
    return background_task(lambda stopped: _watch(database, settings, locks, first_look_s, stopped))


async def _watch(
    database: Database, settings: Settings, locks: Locks, first_look_s: float, stopped: Stopped
) -> None:
    await asyncio.sleep(first_look_s)
    while True:
        try:
            await asyncio.to_thread(carry_out_alone, database, settings, locks, stopped)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("retention")
        await asyncio.sleep(LOOK_EVERY_S)


def carry_out_alone(database: Database, settings: Settings, locks: Locks, stopped: Stopped) -> None:
    """Carry out what is due unless another process is at it."""
    with suppress(LockTaken), locks.held("retention"):
        every_study(database, settings, stopped)


def every_study(database: Database, settings: Settings, stopped: Stopped) -> None:
    """Erase what is due of each study that declares a period, and log it; delete old drafts of the builder.

    Parameters
    ----------
    stopped : callable
        Asked between two transactions; once true no further one begins.
    """
    with database.write() as session:
        repository.delete_drafts(session, now() - DRAFTS_FOR)
    with database.read() as session:
        studies = studies_with_period(session)
    for study in studies:
        try:
            done = carry_out(database, settings, study, stopped)
        except Exception:  # the other studies keep to what they declare, whatever went wrong with this one
            LOG.exception("retention of %s", study)
            continue
        if done.identifiers or done.visits:
            LOG.info(
                "retention of %s: identifiers of %d visits, %d visits erased",
                study,
                done.identifiers,
                done.visits,
            )
