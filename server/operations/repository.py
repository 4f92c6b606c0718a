"""What the doctor, the metrics and backups ask of the whole database."""

from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import Connection, Engine, func, or_, select, text
from sqlalchemy.orm import Session

from server.models import (
    Account,
    ApiToken,
    AuditEntry,
    Clip,
    Link,
    Study,
    StudyGrant,
    StudyRun,
    WorkspaceMember,
)


class RunCount(NamedTuple):
    """Runs of one study that are alike in phase, origin and status."""

    study: str
    phase: str
    origin: str
    status: str
    runs: int


class ClipSize(NamedTuple):
    """A clip's hash and its length in bytes."""

    sha256: str
    bytes: int


def run_counts(session: Session) -> list[RunCount]:
    """The runs of all studies, previews left out."""
    alike = (Study.name, StudyRun.phase, StudyRun.origin, StudyRun.status)
    query = select(*alike, func.count()).join(Study, Study.id == StudyRun.study_id)
    rows = session.execute(query.where(StudyRun.origin != "preview").group_by(*alike))
    return [RunCount(*row) for row in rows]


def clip_sizes(session: Session) -> list[ClipSize]:
    """Every clip that a study names."""
    return [ClipSize(*row) for row in session.execute(select(Clip.sha256, Clip.bytes))]


def clip_hashes(connection: Connection) -> list[str]:
    """The hashes of all clips, ascending; of a database of any revision."""
    return list(connection.scalars(text("SELECT sha256 FROM clips ORDER BY sha256")))


def study_count(session: Session) -> int:
    """How many studies there are."""
    return session.scalar(select(func.count()).select_from(Study)) or 0


def owner_count(session: Session) -> int:
    """Owners who may sign in."""
    query = select(func.count()).where(Account.disabled_at.is_(None), Account.role == "owner")
    return session.scalar(query) or 0


def tokens_ending_after(session: Session, latest: datetime) -> list[tuple[str, str]]:
    """Name and account of open API tokens that end after a moment, or never."""
    query = select(ApiToken.name, Account.name).join(Account, Account.id == ApiToken.account_id)
    late = or_(ApiToken.expires_at.is_(None), ApiToken.expires_at > latest)
    query = query.where(ApiToken.revoked_at.is_(None), Account.disabled_at.is_(None), late)
    return [(token, account) for token, account in session.execute(query.order_by(ApiToken.id))]


def recruiters(session: Session) -> list[tuple[str, bool, dict[str, Any] | None]]:
    """Each stored recruiter: its study's name, whether it is of a single link, and what is declared."""
    of_studies = select(Study.name, Study.recruiter).where(Study.recruiter.is_not(None)).order_by(Study.id)
    of_links = select(Study.name, Link.recruiter).join(Study, Study.id == Link.study_id).order_by(Link.id)
    of_links = of_links.where(Link.recruiter.is_not(None), Link.revoked_at.is_(None))
    return [(name, False, declared) for name, declared in session.execute(of_studies)] + [
        (name, True, declared) for name, declared in session.execute(of_links)
    ]


def count_without_second_factor(session: Session) -> int:
    """People who may sign in by a password alone."""
    query = select(func.count()).where(Account.disabled_at.is_(None), Account.totp_confirmed_at.is_(None))
    return session.scalar(query) or 0


def sqlite_complaint(session: Session) -> str:
    """The first thing SQLite finds wrong with its file; `ok` for none."""
    return str(session.scalar(text("PRAGMA quick_check(1)")))


def postgres_setting(session: Session, name: str) -> str:
    """A setting of the PostgreSQL server."""
    return str(session.scalar(text(f"SHOW {name}")))


def session_is_kept(engine: Engine) -> bool:
    """Whether a session of PostgreSQL has the same process behind it in each of its transactions.

    A pool in transaction mode hands the process that a transaction left to the next one who asks; here
    that is a second connection, which keeps it while the first asks again.
    """
    process = text("SELECT pg_backend_pid()")
    with engine.connect() as first, engine.connect() as second:
        before = first.scalar(process)
        first.commit()
        second.scalar(process)
        return bool(first.scalar(process) == before)


def newest_entry(session: Session) -> datetime | None:
    """Time of the newest entry of the audit log; None if it is empty."""
    return session.scalar(select(func.max(AuditEntry.at)))


def open_study_names(session: Session) -> list[str]:
    """The studies that people can begin, or are taking part in."""
    query = select(Study.name).where(Study.status.in_(("pilot", "live")), Study.archived_at.is_(None))
    return list(session.scalars(query.order_by(Study.id)))


def owner_addresses(session: Session, study: Study) -> list[str]:
    """Confirmed email addresses of a study's owners: of its workspace, or by a grant."""
    members = select(WorkspaceMember.account_id).where(
        WorkspaceMember.workspace_id == study.workspace_id, WorkspaceMember.role == "owner"
    )
    granted = select(StudyGrant.account_id).where(
        StudyGrant.study_id == study.id, StudyGrant.granted == "own"
    )
    query = select(Account.email).where(
        Account.disabled_at.is_(None),
        Account.email.is_not(None),
        or_(Account.id.in_(members), Account.id.in_(granted)),
    )
    return sorted({str(address) for address in session.scalars(query)})


def ways_recorded(session: Session, action: str, study: str) -> dict[str, set[str]]:
    """By which ways the events arrived that audit entries of this action name."""
    query = select(AuditEntry.details).where(AuditEntry.action == action, AuditEntry.target == study)
    ways: dict[str, set[str]] = {}
    for details in session.scalars(query):
        ways.setdefault(str(details.get("event")), set()).update(details.get("by", ()))
    return ways
