"""A run gets its place: group, slot, and the trials that follow from them."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment import Trial
from experiments.assignment.groups import name_of, names, seat_of
from experiments.assignment.order import with_checks
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from server.models import Link, StudyRun
from server.participation import run_repository, series
from server.participation.refusals import GroupRefused
from server.participation.run_repository import compared_answers
from server.participation.versions import LoadedVersion

# Into which groups a run may come: by turn, by its link, or by an answer; and which have places left.

PARAMETER = "group"
COUNTED_ORIGINS = ("participant", "pilot")


def check_parameter(experiment: Experiment, link: Link, query: Mapping[str, str]) -> None:
    """GroupRefused where the address asks for a group that its link is not for."""
    asked = query.get(PARAMETER)
    if asked is None or len(names(experiment)) < 2 or asked == link.group_name:
        return
    raise GroupRefused(
        f"Expected an address without `{PARAMETER}`, got `{PARAMETER}={asked[:60]}`: participants cannot "
        f"choose their group. Please open the link exactly as you received it."
    )


def leads_nowhere(experiment: Experiment, link: Link) -> bool:
    """True where links decide the group and this one, meant for people, is for none that there is."""
    by_link = experiment.groups.by == "link" and link.kind != "preview" and not link.synthetic
    return by_link and link.group_name not in names(experiment)


def open_turns(
    session: Session, experiment: Experiment, version_id: int, origin: str, name: str = ""
) -> list[int]:
    """The groups with places left, by their turns: all of them, or the one called `name` if it has.

    Parameters
    ----------
    name : str, optional
        Of the group that link or answer decided; empty where groups take turns.
    """
    every = names(experiment)
    turns = [turn for turn, known in enumerate(every) if name in ("", known)]
    quotas = experiment.groups.quotas
    if not quotas or origin not in COUNTED_ORIGINS:
        return turns
    lease = timedelta(minutes=experiment.session.lease_minutes)
    # Each origin for itself: pilot runs must not take the places that people are recruited for.
    taken = run_repository.places_by_group(session, version_id, origin, lease)
    return [turn for turn in turns if every[turn] not in quotas or taken[every[turn]] < quotas[every[turn]]]


# A run gets its place: group, slot, and the trials that follow from them.


# Decision 0162: Counterbalancing assigns slots, not conditions.
def assign_slot(session: Session, run: StudyRun, loaded: LoadedVersion, turns: Sequence[int]) -> None:
    """Give a stored run the first free slot of the groups with these turns, and its trials.

    The study must be held (`repository.lock_study`): two runs that look at once would get one slot.
    """
    experiment = loaded.experiment
    lease = timedelta(minutes=experiment.session.lease_minutes)
    every = len(names(experiment))
    if len(turns) == every:
        run.slot = run_repository.free_slot(session, run.version_id, run.origin, lease)
    else:
        run.slot = run_repository.free_slot_of(session, run.version_id, run.origin, lease, every, turns)
    run.group_name = name_of(seat_of(experiment, run.slot).levels)
    trials = _trials(session, run, experiment, lease)
    # After the kind has assigned its trials: checks go between them, and change none.
    trials = with_checks(experiment, trials, run.seed, len(loaded.checks))
    run.trials_total = len(trials)
    # The run has to be stored before rows that refer to it.
    session.flush()
    run_repository.add_trials(session, _trial_rows(run, loaded, trials), _clip_rows(run, loaded, trials))
    if KINDS[experiment.trial.kind].adapts:
        series.add_places(session.connection(), run, loaded, trials)


def _trials(session: Session, run: StudyRun, experiment: Experiment, lease: timedelta) -> list[Trial]:
    kind = KINDS[experiment.trial.kind]
    if kind.assign_by is None or not kind.chooses(experiment):
        return kind.assign(experiment, run.seed, run.slot)
    stored = compared_answers(session, run.version_id, run.origin, lease)
    return kind.assign_by(experiment, run.seed, run.slot, stored)


def _trial_rows(run: StudyRun, loaded: LoadedVersion, trials: list[Trial]) -> list[dict[str, Any]]:
    return [
        {
            "study_run_id": run.id,
            "trial_index": index,
            "kind": trial.kind,
            "block": trial.block,
            "block_label": trial.block_label,
            "expected_response": _expected_response(loaded, trial),
        }
        for index, trial in enumerate(trials)
    ]


def _expected_response(loaded: LoadedVersion, trial: Trial) -> int | None:
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
        for position, (role, clip) in enumerate(_clips_of_trial(loaded, trial))
    ]


def _clips_of_trial(loaded: LoadedVersion, trial: Trial) -> list[tuple[str, int]]:
    """Role and id of each clip of a trial."""
    if trial.check is not None:
        return [("shown", loaded.checks[trial.check].ident)]
    return [(shown.role, loaded.places[shown.clip.cell, shown.clip.exemplar]) for shown in trial.shown]
