"""What an experimenter should know before a study goes live."""

from collections.abc import Callable, Iterator

from sqlalchemy.orm import Session

from experiments.level_leaks import reported_leaks
from experiments.manifest import Manifest
from server.accounts.identity import Identity
from server.models import Study, StudyVersion
from server.studies.lookup import active_version, find_study
from server.studies.schemas import LaunchCheck

Check = Callable[[Study, StudyVersion], Iterator[LaunchCheck]]


def launch_checks(session: Session, name: str, identity: Identity) -> list[LaunchCheck]:
    """What speaks against opening the active version of a study, blocking findings first."""
    study = find_study(session, name, identity, "view")
    version = active_version(session, study)
    findings = [finding for check in _CHECKS for finding in check(study, version)]
    return sorted(findings, key=lambda finding: not finding.blocks)


def _levels_told_apart(_study: Study, version: StudyVersion) -> Iterator[LaunchCheck]:
    """Levels that raters can recognize by something other than the factor."""
    manifest = Manifest.model_validate(version.manifest)
    for sentence in reported_leaks(manifest.clips):
        yield LaunchCheck(
            kind="levels_told_apart", blocks=False, text=f"{sentence[:1].upper()}{sentence[1:]}."
        )


_CHECKS: tuple[Check, ...] = (_levels_told_apart,)
