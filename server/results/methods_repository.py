"""The numbers of the Methods paragraph, each with the query that gives it.

The queries are for people who doubt a number: each gives its own. Fewer queries reach the database. Runs
are counted in one pass, answers to checks by the index that has them alone, and plays are read from the
tallies, which are kept with each rating and checked by a full count (`server.participation.tally_pools`).
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from pydantic_core import from_json
from sqlalchemy import ColumnElement, and_, case, func, select, text
from sqlalchemy.orm import Session

from server.models import StudyRun, StudyVersion
from server.participation.recruiter import NAMES
from server.participation.tally_repository import counts_of

RUNS = (
    "SELECT count(*) FROM study_runs r JOIN study_versions v ON v.id = r.version_id "
    "WHERE r.study_id = :study AND r.origin = :origin AND v.series = :series"
)
PLAYS = (
    "SELECT count(*) FROM study_runs r JOIN study_versions v ON v.id = r.version_id "
    "JOIN assigned_trials a ON a.study_run_id = r.id "
    "JOIN trial_ratings t ON t.study_run_id = a.study_run_id AND t.trial_index = a.trial_index "
    "WHERE r.study_id = :study AND r.origin = :origin AND v.series = :series AND r.status = 'complete'"
)
COMPLETE = "r.status = 'complete'"
EXTRA = "a.kind <> 'main'"
"""As the index of trials that are not main ones has it, so that it is used."""
ASKED = f"{EXTRA} AND a.kind = 'check' AND t.verdict <> 'failed'"
OTHER_WAY = "coalesce(CAST(t.payload ->> 'other_way' AS text), '0') IN ('1', 'true')"
"""As SQLite and PostgreSQL write a true of JSON."""
RESTARTED = "r.status = 'withdrawn' AND r.client_id LIKE '%:' || r.public_id"
"""A visit that a new one of the same person took the place of (`server.participation.links`)."""
GONE = f"r.status = 'withdrawn' AND r.erased_at IS NULL AND NOT ({RESTARTED})"


PRESSES = "CAST(e.interaction AS text) LIKE '{%'"
"""A null of JSON is stored as text, too."""


def _evidence_with(condition: str = "TRUE") -> str:
    # `condition` is always one of those below: nobody's input reaches the SQL.
    return f"EXISTS (SELECT 1 FROM answer_evidence e WHERE e.study_run_id = r.id AND {condition})"  # noqa: S608


OF_RUNS: dict[str, str] = {
    "begun": "TRUE",
    "by_personal_link": "EXISTS (SELECT 1 FROM links l WHERE l.id = r.link_id AND l.kind = 'personal')",
    **{f"by_{kind}": f"r.recruiter = '{kind}'" for kind in NAMES},
    "by_recruiter": "EXISTS (SELECT 1 FROM recruiter_identities i "
    "WHERE i.study_run_id = r.id AND i.identifier_hash <> '')",
    "agreed": "r.consented_at IS NOT NULL",
    "screened_out": "r.status = 'screened_out'",
    "withdrew": f"{GONE} AND r.consented_at IS NOT NULL",
    "declined": f"{GONE} AND r.consented_at IS NULL",
    "restarted": f"{RESTARTED} AND r.erased_at IS NULL",
    "erased": "r.erased_at IS NOT NULL",
    "unfinished": "r.status = 'active'",
    "complete": COMPLETE,
    "excluded_by_hand": "r.excluded",
    "calibrated": f"{COMPLETE} AND r.px_per_mm IS NOT NULL",
    "likely": f"{COMPLETE} AND r.evidence_verdict = 'likely'",
    "unclear": f"{COMPLETE} AND r.evidence_verdict = 'unclear'",
    "unlikely": f"{COMPLETE} AND r.evidence_verdict = 'unlikely'",
    "not_judged": f"{COMPLETE} AND coalesce(r.evidence_verdict, 'not_judged') = 'not_judged'",
    "with_tickets": f"{COMPLETE} AND {_evidence_with()}",
    "with_digests": f"{COMPLETE} AND {_evidence_with('e.digest IS NOT NULL')}",
    "with_presses": f"{COMPLETE} AND {_evidence_with(PRESSES)}",
    "warned": "EXISTS (SELECT 1 FROM run_events e WHERE e.study_run_id = r.id AND e.type = 'warned')",
    "ended_by_warnings": "EXISTS (SELECT 1 FROM run_events e WHERE e.study_run_id = r.id "
    "AND e.type = 'screened_out' AND CAST(e.data AS text) LIKE '%\"lapse\"%')",
    "refused": "EXISTS (SELECT 1 FROM run_events e "
    "WHERE e.study_run_id = r.id AND e.type IN ('answer_refused', 'view_refused'))",
}
OF_CHECKS: dict[str, str] = {
    "checks": f"{EXTRA} AND a.kind = 'attention'",
    "motion_checks": f"{ASKED} AND NOT {OTHER_WAY}",
    "motion_checks_right": f"{ASKED} AND CAST(t.payload ->> 'check' AS integer) = a.expected_response",
    "motion_checks_other_way": f"{EXTRA} AND a.kind = 'check' AND {OTHER_WAY}",
}
MAIN = "a.kind = 'main'"
OF_PLAYS: dict[str, str] = {
    "plays": MAIN,
    **{
        f"plays_{verdict}": f"{MAIN} AND t.verdict = '{verdict}'"
        for verdict in ("good", "uncertain", "flagged", "failed")
    },
    "plays_by_frame": f"{MAIN} AND t.method = 'webcodecs'",
    "plays_by_video": f"{MAIN} AND t.method = 'video'",
    "plays_not_drawn": f"{MAIN} AND t.method = 'none'",
}
QUERIES: dict[str, str] = {
    name: " AND ".join((counted, condition))
    for counted, conditions in ((RUNS, OF_RUNS), (PLAYS, OF_CHECKS), (PLAYS, OF_PLAYS))
    for name, condition in conditions.items()
}
"""Runs and plays of one study, origin and data series."""


@dataclass(frozen=True)
class Number:
    """A number and where it comes from: a query, the key of a report, or that of the declaration."""

    name: str
    value: int
    source: str


class UsedVersion(NamedTuple):
    """A version of a series, with the visits of one origin that it was used for."""

    number: int
    begun: int
    complete: int


def numbers(session: Session, study: int, origin: str, series: int) -> dict[str, Number]:
    """Every number of `QUERIES`, and how many plays were flagged by which rule."""
    of: dict[str, int | str] = {"study": study, "origin": origin, "series": series}
    values = _at_once(session, RUNS, OF_RUNS, of) | _at_once(session, PLAYS, OF_CHECKS, of, EXTRA)
    plays = _plays(session, study, origin, series)
    values |= _play_numbers(plays)
    known = {name: Number(name, values[name], _filled_query(query, of)) for name, query in QUERIES.items()}
    for rule, number in _flagged_by(plays):
        name = f"plays_flagged_by_{rule}"
        query = f"{PLAYS} AND {MAIN} AND t.verdict = 'flagged' AND t.verdict_rule = '{rule}'"
        known[name] = Number(name, number, _filled_query(query, of))
    return known


def used_versions(session: Session, study: int, origin: str, series: int) -> list[UsedVersion]:
    """The versions of a series that visits of an origin were begun with, oldest first."""
    begun = func.count()
    complete = func.sum(case((StudyRun.status == "complete", 1), else_=0))
    query = select(StudyVersion.number, begun, complete)
    query = query.join(StudyRun, StudyRun.version_id == StudyVersion.id)
    query = query.where(_in_series(study, origin, series)).group_by(StudyVersion.number)
    rows = session.execute(query.order_by(StudyVersion.number))
    return [UsedVersion(number, int(visits), int(done or 0)) for number, visits, done in rows]


def begun_with(study: int, origin: str, series: int, versions: Iterable[int], visits: int) -> Number:
    """How many visits began with one of these versions."""
    listed = ", ".join(map(str, versions))
    name = f"begun_with_{listed.replace(', ', '_')}"
    query = f"{RUNS} AND v.number IN ({listed})"
    return Number(name, visits, _filled_query(query, {"study": study, "origin": origin, "series": series}))


def _at_once(
    session: Session,
    counted: str,
    conditions: Mapping[str, str],
    of: Mapping[str, int | str],
    also: str = "TRUE",
) -> dict[str, int]:
    """The counts of several conditions in one pass."""
    sums = ", ".join(
        f"coalesce(sum(CASE WHEN {condition} THEN 1 ELSE 0 END), 0) AS {name}"
        for name, condition in conditions.items()
    )
    query = counted.replace("count(*)", sums, 1)
    [row] = session.execute(text(f"{query} AND {also}"), of).mappings()
    return {name: int(row[name]) for name in conditions}


def _in_series(study: int, origin: str, series: int) -> ColumnElement[bool]:
    return and_(StudyRun.study_id == study, StudyRun.origin == origin, StudyVersion.series == series)


Plays = Counter[tuple[str, str, str]]
"""(verdict, method, rule) -> plays of main trials in completed visits."""


def _plays(session: Session, study: int, origin: str, series: int) -> Plays:
    of_series = select(StudyVersion.id).where(StudyVersion.study_id == study, StudyVersion.series == series)
    runs = and_(
        StudyRun.study_id == study,
        StudyRun.origin == origin,
        StudyRun.status == "complete",
        StudyRun.version_id.in_(of_series),
    )
    made: Plays = Counter()
    for kept in counts_of(session, runs):
        for key, number in from_json(kept.counts)["plays"].items():
            verdict, method, rule = key.split(" ")
            made[verdict, method, rule] += number
    return made


def _play_numbers(plays: Plays) -> dict[str, int]:
    verdicts, methods = Counter[str](), Counter[str]()
    for (verdict, method, _), number in plays.items():
        verdicts[verdict] += number
        methods[method] += number
    return {
        "plays": plays.total(),
        **{f"plays_{verdict}": verdicts[verdict] for verdict in ("good", "uncertain", "flagged", "failed")},
        "plays_by_frame": methods["webcodecs"],
        "plays_by_video": methods["video"],
        "plays_not_drawn": methods["none"],
    }


def _flagged_by(plays: Plays) -> list[tuple[str, int]]:
    rules = Counter[str]()
    for (verdict, _, rule), number in plays.items():
        if verdict == "flagged":
            rules[rule] += number
    return rules.most_common()


def _filled_query(query: str, values: Mapping[str, int | str]) -> str:
    for name, value in values.items():
        query = query.replace(f":{name}", str(value) if isinstance(value, int) else f"'{value}'")
    return query
