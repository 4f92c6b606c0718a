"""Queries of a study's life cycle."""

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.errors import NotFound
from server.models import Study, StudyVersion, VersionClip


def version_numbered(session: Session, study: Study, number: int) -> StudyVersion:
    """The version of a study with this number; NotFound where there is none."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id, StudyVersion.number == number)
    version = session.scalar(query)
    if version is None:
        raise NotFound(f"Study '{study.name}' has no version {number}.")
    return version


def clips_of(session: Session, version: StudyVersion) -> dict[tuple[str, int], tuple[str, str]]:
    """(cell, exemplar) -> (SHA-256, file name) of a version's clips; those of checks are under `check`."""
    query = select(VersionClip.cell, VersionClip.exemplar, VersionClip.clip_sha256, VersionClip.file)
    rows = session.execute(query.where(VersionClip.version_id == version.id).order_by(VersionClip.id))
    return {(cell or "check", exemplar): (sha256, file) for cell, exemplar, sha256, file in rows}
