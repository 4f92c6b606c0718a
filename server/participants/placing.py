"""A run gets its place: group, slot, and the trials that follow from them."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment.checks import with_checks
from experiments.assignment.groups import name_of, names, seat_of
from experiments.assignment.trial import Trial
from experiments.definition import Experiment
from experiments.trials import KINDS
from server.models import StudyRun
from server.participants import places_repository, repository
from server.participants.comparisons_repository import compared
from server.trials.series import service as series
from server.versions import LoadedVersion


def assign_slot(session: Session, run: StudyRun, loaded: LoadedVersion, turns: Sequence[int]) -> None:
    """Give a stored run the first free slot of the groups with these turns, and its trials.

    The study must be held (`repository.lock_study`): two runs that look at once would get one slot.
    """
    experiment = loaded.experiment
    lease = timedelta(minutes=experiment.session.lease_minutes)
    every = len(names(experiment))
    if len(turns) == every:
        run.slot = places_repository.free_slot(session, run.version_id, run.origin, lease)
    else:
        run.slot = places_repository.free_slot_of(session, run.version_id, run.origin, lease, every, turns)
    run.group_name = name_of(seat_of(experiment, run.slot).levels)
    trials = _trials(session, run, experiment, lease)
    trials = with_checks(experiment, trials, run.seed, len(loaded.checks))
    run.trials_total = len(trials)
    session.flush()
    repository.add_trials(session, _trial_rows(run, loaded, trials), _clip_rows(run, loaded, trials))
    if KINDS[experiment.trial.kind].adapts:
        series.add_places(session.connection(), run, loaded, trials)


def _trials(session: Session, run: StudyRun, experiment: Experiment, lease: timedelta) -> list[Trial]:
    kind = KINDS[experiment.trial.kind]
    if kind.assign_by is None or not kind.chooses(experiment):
        return kind.assign(experiment, run.seed, run.slot)
    stored = compared(session, run.version_id, run.origin, lease)
    return kind.assign_by(experiment, run.seed, run.slot, stored)


def _trial_rows(run: StudyRun, loaded: LoadedVersion, trials: list[Trial]) -> list[dict[str, Any]]:
    return [
        {
            "study_run_id": run.id,
            "trial_index": index,
            "kind": trial.kind,
            "block": trial.block,
            "block_label": trial.block_label,
            "expected_response": _expected(loaded, trial),
        }
        for index, trial in enumerate(trials)
    ]


def _expected(loaded: LoadedVersion, trial: Trial) -> int | None:
    return trial.expected_response if trial.check is None else loaded.checks[trial.check].answer


def _clip_rows(run: StudyRun, loaded: LoadedVersion, trials: list[Trial]) -> list[dict[str, Any]]:
    return [
        {
            "study_run_id": run.id,
            "trial_index": index,
            "role": role,
            "position": position,
            "version_clip_id": clip,
        }
        for index, trial in enumerate(trials)
        for position, (role, clip) in enumerate(_shown(loaded, trial))
    ]


def _shown(loaded: LoadedVersion, trial: Trial) -> list[tuple[str, int]]:
    """Role and id of each clip of a trial."""
    if trial.check is not None:
        return [("shown", loaded.checks[trial.check].ident)]
    return [(shown.role, loaded.places[shown.clip.cell, shown.clip.exemplar]) for shown in trial.shown]
