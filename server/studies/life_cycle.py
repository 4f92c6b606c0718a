"""A study copied, put into the archive and taken out."""

from sqlalchemy.orm import Session

from experiments.manifest import Manifest
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.clock import now
from server.errors import Conflict
from server.studies.edits import for_edit
from server.studies.importing import add_version, create_study
from server.studies.life_schemas import ArchiveStudy, CloneStudy
from server.studies.lookup import definition_of, find_study, version_numbered
from server.workspaces.service import place_of_copy


def clone(session: Session, name: str, order: CloneStudy, identity: Identity) -> None:
    """A new draft with declaration and clips of one version; nothing of its people comes along.

    Links, quota and recruiter stay behind too: completion codes belong to one study.
    """
    source = find_study(session, name, identity, "edit")
    version = version_numbered(session, source, order.version or source.active_version)
    home = place_of_copy(session, source, identity, order.workspace)
    copy = create_study(session, order.name, definition_of(version), identity, home)
    note = f"copied from {source.name}, version {version.number}"
    manifest = Manifest.model_validate(version.manifest)
    add_version(session, copy, version.definition_toml, definition_of(version), manifest, identity, note)
    copy.revision = 1


def archive(session: Session, name: str, order: ArchiveStudy, identity: Identity) -> None:
    """Into the archive or out of it; Conflict while people can take part."""
    study = for_edit(session, name, order.revision, identity, "run", archived=True)
    if order.archived == (study.archived_at is not None):
        return
    if order.archived and study.status in ("pilot", "live"):
        raise Conflict(f"A study that is {study.status} cannot go into the archive; close it first.")
    study.archived_at = now() if order.archived else None
    study.revision += 1
    record(
        session,
        identity,
        "study archived" if order.archived else "study taken out of the archive",
        "study",
        name,
    )
