"""Find a study, its active version and what that version declares."""

from sqlalchemy import select
from sqlalchemy.orm import Session

from experiments.definition import Experiment
from experiments.errors import did_you_mean
from experiments.schema.stored import load_stored
from server.errors import NotFound
from server.models import Study, StudyVersion


def find_study(session: Session, name: str) -> Study:
    """The study called `name`; NotFound, with the nearest name, where there is none."""
    study = session.scalar(select(Study).where(Study.name == name))
    if study is None:
        names = session.scalars(select(Study.name)).all()
        raise NotFound(f"There is no study '{name[:60]}'{did_you_mean(name, names)}")
    return study


def active_version(session: Session, study: Study) -> StudyVersion:
    """The version new runs of a study use."""
    query = select(StudyVersion).where(
        StudyVersion.study_id == study.id, StudyVersion.number == study.active_version
    )
    version = session.scalar(query)
    if version is None:
        raise NotFound(f"Study '{study.name}' has no version {study.active_version}.")
    return version


def active_definition(session: Session, study: Study) -> Experiment:
    """The declaration new runs of a study use."""
    return definition_of(active_version(session, study))


def all_definitions(session: Session, study: Study) -> list[Experiment]:
    """The declarations of all versions of a study, oldest first."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id).order_by(StudyVersion.number)
    return [definition_of(version) for version in session.scalars(query)]


def definition_of(version: StudyVersion) -> Experiment:
    """What a version declares."""
    # A definition with this hash never changes, so it is parsed once.
    if version.definition_sha256 not in _parsed:
        _parsed[version.definition_sha256] = load_stored(version.definition, version.format)
    return _parsed[version.definition_sha256]


_parsed: dict[str, Experiment] = {}
