"""The sealed plan of a study: sealed once, before the first participant; printed as a page."""

import json
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from sqlalchemy.orm import Session

from experiments.errors import counted
from experiments.manifest import Manifest
from experiments.schema.canonical import canonical, definition_sha256
from experiments.seal import Seal, clips_sha256
from server.accounts.audit import record
from server.accounts.identity import Identity
from server.core.errors import Conflict
from server.core.values import iso, now
from server.exports.repository import people_of_series, sealed_document
from server.models import Study
from server.participation.run_repository import lock_study
from server.studies.lookup import active_version, definition_of, must_not_be_archived

# Seal the plan of a study, once, before the first participant; the audit log keeps it.

ACTION = "plan sealed"


def seal_of(session: Session, study: Study) -> Seal | None:
    """The sealed plan of the active version's data series; None where it was not sealed."""
    document = sealed_document(session, study.name, active_version(session, study).series, ACTION)
    return Seal.model_validate(document) if document else None


def people_begun(session: Session, study: Study) -> int:
    """How many participants have begun in the active version's data series."""
    return people_of_series(session, study, active_version(session, study).series)


# Decision 0642: The audit log keeps the sealed plan.
def seal_plan(
    session: Session, study: Study, identity: Identity | None, power: dict[str, Any] | None
) -> Seal:
    """Seal the active version; Conflict where it is sealed or archived, or people have taken part already."""
    # Held until the seal is stored: nobody begins meanwhile, nor does another seal.
    study = lock_study(session, study.id)
    must_not_be_archived(study)
    version = active_version(session, study)
    if sealed := seal_of(session, study):
        raise Conflict(f"The plan was already sealed {sealed.sealed_at}. A seal cannot be replaced.")
    if people := people_of_series(session, study, version.series):
        raise Conflict(
            f"{counted(people, 'participant')} already started. A plan can only be sealed before the "
            f"first. Without a seal, the report cannot list deviations."
        )
    experiment, manifest = definition_of(version), Manifest.model_validate(version.manifest)
    seal = Seal(
        study=study.name,
        version=version.number,
        sealed_at=iso(now()),
        definition=version.definition,
        definition_format=version.format,
        definition_sha256=definition_sha256(experiment),
        clips_sha256=clips_sha256((clip.cell, clip.exemplar, clip.sha256) for clip in manifest.clips),
        power=power,
    )
    record(
        session, identity, ACTION, "study", study.name,
        sha256=seal.sha256, series=version.series, seal=seal.model_dump(mode="json"),
    )  # fmt: skip
    return seal


# The sealed plan as a page that prints well.

TABLES = (
    "participants", "factors", "exemplars", "assignment", "groups", "blocks", "practice", "trial",
    "attention", "playback", "screening", "exclusions", "analysis", "forms", "display",
)  # fmt: skip


def page(seal: Seal) -> str:
    """HTML without scripts or anything from elsewhere."""
    declared = canonical(seal.experiment, frozenset(), {})
    parts = [(key, _text(declared[key])) for key in TABLES if key in declared]
    environment = Environment(
        loader=PackageLoader("server", "exports/templates"), autoescape=True, undefined=StrictUndefined
    )
    template = environment.get_template("seal.html.j2")
    return template.render(
        seal=seal, title=seal.experiment.title, parts=parts, power=_text(seal.power) if seal.power else ""
    )


def _text(value: object) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False)
