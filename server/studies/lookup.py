"""Find a study, its active version and what that version declares."""

from sqlalchemy.orm import Session

from experiments.declaration.experiment import Experiment
from experiments.errors import did_you_mean
from experiments.load import load_stored
from server.accounts import workspace_repository as workspaces
from server.accounts.identity import Identity, NotAllowed, Operator, SecondFactorNeeded
from server.accounts.workspace_repository import ordered_rights
from server.core.errors import Conflict, NotFound
from server.models import RIGHTS, Right, Study, StudyVersion
from server.studies import repository


class UnknownStudy(NotFound):
    """There is no such study, or none that the account may see."""

    audited = True


# Decision 0685: Workspaces are checked by the query that finds a study.
def find_study(session: Session, name: str, identity: Identity | Operator, right: Right) -> Study:
    """The study called `name`, for one who has this right on it; see `study_with_rights`."""
    study, _ = study_with_rights(session, name, identity, right)
    return study


def study_with_rights(
    session: Session, name: str, identity: Identity | Operator, right: Right
) -> tuple[Study, frozenset[Right]]:
    """A study and all her rights on it, for one who has this right: the one way from a name to a study.

    Raises
    ------
    NotFound
        There is none, or none that she may see; both are answered alike, with the nearest name she may see.
    NotAllowed
        She may see it, but lacks the right.
    SecondFactorNeeded
        Its workspace asks for a second factor, and she signed in without one.
    """
    study = workspaces.study_seen_by(session, name, identity)
    if study is None:
        names = workspaces.study_names_seen_by(session, identity)
        hint = did_you_mean(name, names)
        if not names and isinstance(identity, Operator):
            hint = (
                "; this database has no studies. If the server uses another data folder, set "
                "PALPEBRA_DATA_FOLDER to the one that it printed"
            )
        raise UnknownStudy(f"There is no study '{name[:60]}'{hint}")
    if isinstance(identity, Operator):
        return study, frozenset(RIGHTS)
    rights = workspaces.rights_on(session, [study], identity)[study.id]
    _check(session, study, identity, right, rights)
    return study, rights


def _check(
    session: Session, study: Study, identity: Identity, right: Right, rights: frozenset[Right]
) -> None:
    if right not in rights:
        held = " and ".join(ordered_rights(rights))
        raise NotAllowed(f"This requires the right '{right}' on the study '{study.name}'; you have {held}.")
    workspace = workspaces.workspace_of(session, study)
    if workspace is not None and workspace.second_factor_required and not identity.second_factor:
        raise SecondFactorNeeded(
            f"The workspace '{workspace.title}' requires a second factor. Set one up under My account, or "
            f"sign in again with it."
        )


def must_not_be_archived(study: Study) -> None:
    """Conflict where a study is in the archive: asked before its status, versions, links or seal change.

    Allowed stay, in the archive: what people have a right to and what takes something back (erasure of a
    person, exclusions, withdrawal of links), who may see it (sharing, the workspace it belongs to), and what
    only reads it (copies, downloads, reports, a seal written out again).
    """
    if study.archived_at is not None:
        raise Conflict(
            f"The study '{study.name}' is archived. Remove it from the archive (Settings) before you "
            f"change it."
        )


def version_numbered(session: Session, study: Study, number: int) -> StudyVersion:
    """The version of a study with this number; NotFound where there is none."""
    version = repository.version_numbered(session, study, number)
    if version is None:
        raise NotFound(f"Study '{study.name}' has no version {number}.")
    return version


def active_version(session: Session, study: Study) -> StudyVersion:
    """The version new runs of a study use."""
    return version_numbered(session, study, study.active_version)


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
