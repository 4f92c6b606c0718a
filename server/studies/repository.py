"""Studies, their versions, clips and links, and how many runs each has."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Select, case, delete, func, insert, select
from sqlalchemy.orm import Session, joinedload

from experiments.checks import CHECK_CELL
from server.models import Account, BuilderDraft, Clip, Link, Study, StudyRun, StudyVersion, VersionClip

# Studies, their versions and clips, and how many runs each has.

MAX_ASKED = 500
"""Values that one question to the database holds."""
_OF_PEOPLE = StudyRun.origin != "preview"
StatusCounts = Counter[tuple[int, str]]
"""(number of a study, status of a run) -> runs."""


class SeriesRuns(NamedTuple):
    """Runs of one origin in one data series."""

    series: int
    origin: str
    runs: int


def study_called(session: Session, name: str) -> Study | None:
    """The study of this name."""
    return session.scalar(select(Study).where(Study.name == name))


def all_studies(session: Session) -> list[Study]:
    """Every study in the order they were made."""
    return list(session.scalars(select(Study).order_by(Study.id)))


def open_studies(session: Session) -> list[Study]:
    """The studies that people can take part in, in the order they were made."""
    query = select(Study).where(Study.status.in_(("pilot", "live")))
    return list(session.scalars(query.order_by(Study.id)))


def version_numbered(session: Session, study: Study, number: int) -> StudyVersion | None:
    """The version of a study with this number."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id, StudyVersion.number == number)
    return session.scalar(query)


def versions_of(session: Session, study: Study) -> list[StudyVersion]:
    """The versions of a study, oldest first."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id).order_by(StudyVersion.number)
    return list(session.scalars(query))


def newest_of_series(session: Session, study: Study, series: int) -> StudyVersion | None:
    """The newest version of a data series."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id, StudyVersion.series == series)
    return session.scalar(query.order_by(StudyVersion.number.desc()).limit(1))


def ids_of_series(study: Study, series: int) -> Select[int]:
    """The ids of a series' versions, as part of another query."""
    return select(StudyVersion.id).where(StudyVersion.study_id == study.id, StudyVersion.series == series)


def versions_with_runs(session: Session, study: Study) -> list[tuple[StudyVersion, int]]:
    """The versions of a study, newest first, each with its runs but previews."""
    query = (
        select(StudyVersion, func.count(StudyRun.id))
        .outerjoin(StudyRun, (StudyRun.version_id == StudyVersion.id) & _OF_PEOPLE)
        .where(StudyVersion.study_id == study.id)
        .group_by(StudyVersion.id)
        .order_by(StudyVersion.number.desc())
    )
    return [(version, runs) for version, runs in session.execute(query)]


def versions_by_series(session: Session, study: Study) -> dict[int, list[int]]:
    """Data series -> the numbers of its versions, ascending."""
    query = select(StudyVersion.series, StudyVersion.number).where(StudyVersion.study_id == study.id)
    versions: dict[int, list[int]] = {}
    for series, number in session.execute(query.order_by(StudyVersion.number)):
        versions.setdefault(series, []).append(number)
    return versions


def runs_by_series(session: Session, study: Study) -> list[SeriesRuns]:
    """How many runs but previews each data series has of each origin."""
    query = (
        select(StudyVersion.series, StudyRun.origin, func.count(StudyRun.id))
        .join(StudyRun, StudyRun.version_id == StudyVersion.id)
        .where(StudyVersion.study_id == study.id, _OF_PEOPLE)
        .group_by(StudyVersion.series, StudyRun.origin)
    )
    return [SeriesRuns(*row) for row in session.execute(query)]


def run_count(session: Session, study: Study) -> int:
    """Runs of a study but previews."""
    return session.scalar(select(func.count()).where(StudyRun.study_id == study.id, _OF_PEOPLE)) or 0


def is_completed(session: Session, version: StudyVersion) -> bool:
    """Whether a person completed this version, as a preview too."""
    query = select(StudyRun.id).where(StudyRun.version_id == version.id, StudyRun.status == "complete")
    return session.scalar(query.where(StudyRun.origin != "simulated").limit(1)) is not None


def run_count_of_series(session: Session, study: Study, series: int) -> int:
    """Runs of a data series but previews."""
    query = (
        select(func.count(StudyRun.id))
        .join(StudyVersion, StudyVersion.id == StudyRun.version_id)
        .where(StudyRun.study_id == study.id, StudyVersion.series == series, _OF_PEOPLE)
    )
    return session.scalar(query) or 0


def runs_by_status(session: Session) -> StatusCounts:
    """The runs of all studies but previews."""
    return _by_status(session, _OF_PEOPLE)


def shown_runs_by_status(session: Session, study: Study | None = None) -> StatusCounts:
    """The runs of all studies, or of one: of a pilot those of the pilot, else those of participants."""
    shown = StudyRun.origin == case((Study.status == "pilot", "pilot"), else_="participant")
    return _by_status(session, shown if study is None else shown & (StudyRun.study_id == study.id))


def owners(session: Session) -> dict[int, str]:
    """Study number -> name of the account that created it."""
    query = select(Study.id, Account.name).join(Account, Account.id == Study.created_by)
    return {row.id: row.name for row in session.execute(query)}


def last_activities(session: Session) -> dict[int, datetime]:
    """Study number -> when a participant was last seen in it, or its last version was made."""
    seen = select(StudyRun.study_id, func.max(StudyRun.last_seen_at)).group_by(StudyRun.study_id)
    made = select(StudyVersion.study_id, func.max(StudyVersion.created_at)).group_by(StudyVersion.study_id)
    latest: dict[int, datetime] = {}
    for study, moment in (*session.execute(seen), *session.execute(made)):
        latest[study] = max(latest.get(study, moment), moment)
    return latest


def completions_since(session: Session, moment: datetime) -> list[tuple[int, datetime]]:
    """Study number and moment of every run but previews and simulated ones that was completed since."""
    query = select(StudyRun.study_id, StudyRun.completed_at).where(
        StudyRun.origin.in_(("participant", "pilot")),
        StudyRun.status == "complete",
        StudyRun.completed_at >= moment,
    )
    return [(study, completed) for study, completed in session.execute(query) if completed is not None]


def _by_status(session: Session, counted: ColumnElement[bool]) -> StatusCounts:
    query = select(StudyRun.study_id, StudyRun.status, func.count())
    query = query.join(Study, Study.id == StudyRun.study_id).where(counted)
    rows = session.execute(query.group_by(StudyRun.study_id, StudyRun.status))
    return Counter({(study, status): runs for study, status, runs in rows})


def delete_study(session: Session, study: Study) -> None:
    """Delete a study and the runs it has."""
    for run in session.scalars(select(StudyRun).where(StudyRun.study_id == study.id)):
        session.delete(run)
    session.flush()
    session.delete(study)


def clips_of_design(session: Session, version: StudyVersion) -> list[VersionClip]:
    """The clips of a version but those of checks, by their numbers."""
    query = select(VersionClip).where(VersionClip.version_id == version.id, VersionClip.cell != CHECK_CELL)
    with_bytes = query.options(joinedload(VersionClip.clip)).order_by(VersionClip.id)
    return list(session.scalars(with_bytes))


def clips_by_exemplar(session: Session, version: StudyVersion) -> dict[tuple[str, int], tuple[str, str]]:
    """(cell, exemplar) -> (SHA-256, file name) of a version's clips; those of checks are under `check`."""
    query = select(VersionClip.cell, VersionClip.exemplar, VersionClip.clip_sha256, VersionClip.file)
    rows = session.execute(query.where(VersionClip.version_id == version.id).order_by(VersionClip.id))
    return {(cell or "check", exemplar): (sha256, file) for cell, exemplar, sha256, file in rows}


def known_clips(session: Session, hashes: Iterable[str]) -> set[str]:
    """Those of these SHA-256 that the server has a clip of."""
    asked, known = list(hashes), set[str]()
    for start in range(0, len(asked), MAX_ASKED):
        query = select(Clip.sha256).where(Clip.sha256.in_(asked[start : start + MAX_ASKED]))
        known.update(session.scalars(query))
    return known


def insert_clips(session: Session, rows: Iterable[Mapping[str, Any]]) -> None:
    """Store clips that the server has not had."""
    if values := list(rows):
        session.execute(insert(Clip), values)


def insert_version_clips(session: Session, version: StudyVersion, rows: Iterable[Mapping[str, Any]]) -> None:
    """Give a stored version its clips; they are read from the database when they are asked for."""
    values = [{"version_id": version.id, **row} for row in rows]
    session.execute(insert(VersionClip), values)
    session.expire(version, ["clips"])


# The builder's open tabs and drafts.


def builder_tab(session: Session, study: Study, account_id: int, tab: str) -> BuilderDraft | None:
    """The row of one tab."""
    return session.get(BuilderDraft, (study.id, account_id, tab))


def own_builder_tab(session: Session, study: Study, account_id: int, tab: str) -> BuilderDraft:
    """The row of one tab, which is known to exist."""
    return session.get_one(BuilderDraft, (study.id, account_id, tab))


def drafts_of(session: Session, study: Study, account_id: int) -> list[BuilderDraft]:
    """The drafts of one account, the latest first."""
    mine = (BuilderDraft.study_id == study.id, BuilderDraft.account_id == account_id)
    query = select(BuilderDraft).where(*mine, BuilderDraft.saved_at.is_not(None))
    return list(session.scalars(query.order_by(BuilderDraft.saved_at.desc())))


def tabs_open_since(session: Session, study: Study, since: datetime) -> list[tuple[BuilderDraft, str]]:
    """The tabs heard of since then, each with the name of its account."""
    query = select(BuilderDraft, Account.name).join(Account, Account.id == BuilderDraft.account_id)
    query = query.where(BuilderDraft.study_id == study.id, BuilderDraft.seen_at >= since)
    return [(row, name) for row, name in session.execute(query.order_by(Account.name, BuilderDraft.tab))]


def delete_closed_tabs(session: Session, study: Study, before: datetime) -> None:
    """Forget tabs that were closed before then and left no draft."""
    closed = (BuilderDraft.study_id == study.id, BuilderDraft.seen_at < before)
    session.execute(delete(BuilderDraft).where(*closed, BuilderDraft.saved_at.is_(None)))


# Links into studies, and how many runs each has.


def add_links(session: Session, study: Study, rows: Sequence[dict[str, Any]]) -> None:
    """Store prepared links in one statement, so that raters do not wait for a statement a link."""
    session.execute(insert(Link), [row | {"study_id": study.id} for row in rows])


def find_link(session: Session, study: Study, public_id: str) -> Link | None:
    """The link of a study with this public id, withdrawn or not."""
    return session.scalar(select(Link).where(Link.study_id == study.id, Link.public_id == public_id))


def links_of(session: Session, study: Study) -> list[Link]:
    """The links of a study that have not been withdrawn, in the order they were made."""
    return list(session.scalars(_visible_links(study)))


def number_of_links(session: Session, study: Study) -> int:
    """How many links `links_of` would give."""
    return (
        session.scalar(select(func.count()).select_from(_visible_links(study).order_by(None).subquery())) or 0
    )


def links_after(session: Session, study: Study, link: Link | None, limit: int) -> list[Link]:
    """At most `limit` links in the order they were made, those behind `link`."""
    query = _visible_links(study).limit(limit)
    return list(session.scalars(query if link is None else query.where(Link.id > link.id)))


def runs_by_link(session: Session, links: Sequence[Link]) -> dict[int, tuple[int, int]]:
    """Number of a link -> (runs, complete runs); for one page of links."""
    complete = func.sum(case((StudyRun.status == "complete", 1), else_=0))
    query = select(StudyRun.link_id, func.count(), complete).group_by(StudyRun.link_id)
    rows = session.execute(query.where(StudyRun.link_id.in_([link.id for link in links])))
    return {link: (int(runs), int(done)) for link, runs, done in rows}


def first_general_link(session: Session, study: Study, group: str) -> Link | None:
    """The oldest general link for a group (empty: for none) that belongs to no recruiter."""
    query = _visible_links(study).where(
        Link.kind == "general", Link.recruiter.is_(None), Link.group_name == group
    )
    return session.scalar(query.limit(1))


def recruiters_of_links(session: Session, study: Study) -> list[dict[str, Any]]:
    """The recruiters declared for single links of a study, each once."""
    query = select(Link.recruiter).where(
        Link.study_id == study.id, Link.revoked_at.is_(None), Link.kind != "preview"
    )
    stored = (recruiter for recruiter in session.scalars(query.order_by(Link.id)) if recruiter)
    return list({json.dumps(recruiter, sort_keys=True): recruiter for recruiter in stored}.values())


def has_personal_links(session: Session, study: Study) -> bool:
    """Whether somebody was given a link that is theirs alone."""
    personal = _visible_links(study).where(Link.kind == "personal").limit(1)
    return session.scalar(personal) is not None


def _visible_links(study: Study) -> Select[Link]:
    query = select(Link).where(
        Link.study_id == study.id, Link.revoked_at.is_(None), Link.synthetic.is_(False)
    )
    return query.order_by(Link.id)
