"""The numbers of the Methods paragraph, each with the query that gave it."""

from dataclasses import dataclass

from sqlalchemy import text
from sqlalchemy.orm import Session

RUNS = (
    "SELECT count(*) FROM study_runs r JOIN study_versions v ON v.id = r.version_id "
    "WHERE r.study_id = :study AND r.origin = :origin AND v.series = :series"
)
PLAYS = (
    "SELECT count(*) FROM trial_ratings t "
    "JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index "
    "JOIN study_runs r ON r.id = t.study_run_id JOIN study_versions v ON v.id = r.version_id "
    "WHERE r.study_id = :study AND r.origin = :origin AND v.series = :series AND r.status = 'complete'"
)
COMPLETE = "r.status = 'complete'"
ASKED = "a.kind = 'check' AND t.verdict <> 'failed'"
OTHER_WAY = "coalesce(CAST(t.payload ->> 'other_way' AS text), '0') IN ('1', 'true')"
"""As SQLite and PostgreSQL write a true of JSON."""
OF_RUNS: dict[str, str] = {
    "begun": "TRUE",
    "by_personal_link": "EXISTS (SELECT 1 FROM links l WHERE l.id = r.link_id AND l.kind = 'personal')",
    "by_recruiter": "EXISTS (SELECT 1 FROM recruiter_identities i "
    "WHERE i.study_run_id = r.id AND i.identifier_hash <> '')",
    "agreed": "r.consented_at IS NOT NULL",
    "screened_out": "r.status = 'screened_out'",
    "withdrew": "r.status = 'withdrawn' AND r.erased_at IS NULL",
    "erased": "r.erased_at IS NOT NULL",
    "unfinished": "r.status = 'active'",
    "complete": COMPLETE,
    "excluded_by_hand": "r.excluded",
    "calibrated": f"{COMPLETE} AND r.px_per_mm IS NOT NULL",
    "likely": f"{COMPLETE} AND r.evidence_verdict = 'likely'",
    "unclear": f"{COMPLETE} AND r.evidence_verdict = 'unclear'",
    "unlikely": f"{COMPLETE} AND r.evidence_verdict = 'unlikely'",
    "not_judged": f"{COMPLETE} AND coalesce(r.evidence_verdict, 'not_judged') = 'not_judged'",
    "warned": "EXISTS (SELECT 1 FROM run_events e WHERE e.study_run_id = r.id AND e.type = 'warned')",
    "ended_by_warnings": "EXISTS (SELECT 1 FROM run_events e WHERE e.study_run_id = r.id "
    "AND e.type = 'screened_out' AND CAST(e.data AS text) LIKE '%\"lapse\"%')",
    "refused": "EXISTS (SELECT 1 FROM run_events e "
    "WHERE e.study_run_id = r.id AND e.type IN ('answer_refused', 'view_refused'))",
}
OF_PLAYS: dict[str, str] = {
    "checks": "a.kind = 'attention'",
    "motion_checks": f"{ASKED} AND NOT {OTHER_WAY}",
    "motion_checks_right": f"{ASKED} AND CAST(t.payload ->> 'check' AS integer) = a.expected_response",
    "motion_checks_other_way": f"a.kind = 'check' AND {OTHER_WAY}",
    "plays": "a.kind = 'main'",
    "plays_good": "a.kind = 'main' AND t.verdict = 'good'",
    "plays_uncertain": "a.kind = 'main' AND t.verdict = 'uncertain'",
    "plays_flagged": "a.kind = 'main' AND t.verdict = 'flagged'",
    "plays_failed": "a.kind = 'main' AND t.verdict = 'failed'",
}
QUERIES: dict[str, str] = {
    name: " AND ".join((counted, condition))
    for counted, conditions in ((RUNS, OF_RUNS), (PLAYS, OF_PLAYS))
    for name, condition in conditions.items()
}
"""Runs and plays of one study, origin and data series."""


@dataclass(frozen=True)
class Number:
    """A number and where it comes from: a query, the key of a report, or that of the declaration."""

    name: str
    value: int
    source: str


def numbers(session: Session, study: int, origin: str, series: int) -> dict[str, Number]:
    """Every number of `QUERIES`."""
    of: dict[str, int | str] = {"study": study, "origin": origin, "series": series}
    return {
        name: Number(name, int(session.scalar(text(query), of) or 0), _filled(query, of))
        for name, query in QUERIES.items()
    }


def _filled(query: str, values: dict[str, int | str]) -> str:
    for name, value in values.items():
        query = query.replace(f":{name}", str(value) if isinstance(value, int) else f"'{value}'")
    return query
