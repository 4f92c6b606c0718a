"""Find a study, its active version and what that version declares."""

from sqlalchemy.orm import Session

from experiments.definition import Experiment
from experiments.errors import did_you_mean
from experiments.schema.stored import load_stored
from server.errors import NotFound
from server.models import Study, StudyVersion
from server.studies import repository


def find_study(session: Session, name: str) -> Study:
    """The study called `name`; NotFound, with the nearest name, where there is none."""
    study = repository.study_called(session, name)
    if study is None:
        nearest = did_you_mean(name, repository.study_names(session))
        raise NotFound(f"There is no study '{name[:60]}'{nearest}")
    return study


def active_version(session: Session, study: Study) -> StudyVersion:
    """The version new runs of a study use."""
    version = repository.version_numbered(session, study, study.active_version)
    if version is None:
        raise NotFound(f"Study '{study.name}' has no version {study.active_version}.")
    return version


def active_definition(session: Session, study: Study) -> Experiment:
    """The declaration new runs of a study use."""
    return definition_of(active_version(session, study))


def all_definitions(session: Session, study: Study) -> list[Experiment]:
    """The declarations of all versions of a study, oldest first."""
    return [definition_of(version) for version in repository.versions_of(session, study)]


def definition_of(version: StudyVersion) -> Experiment:
    """What a version declares."""
    # A definition with this hash never changes, so it is parsed once.
    if version.definition_sha256 not in _parsed:
        _parsed[version.definition_sha256] = load_stored(version.definition, version.format)
    return _parsed[version.definition_sha256]


_parsed: dict[str, Experiment] = {}
