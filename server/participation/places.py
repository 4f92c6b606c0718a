"""A run's place and its trials: group, slot, the trials that follow, and how the page gets them."""

import logging
from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment import Trial
from experiments.assignment.groups import name_of, names, seat_of
from experiments.assignment.order import motion_checks_by_block, with_checks
from experiments.checks import CHECK_KINDS, CheckName
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from server.core.db import Database
from server.models import Link, StudyRun
from server.participation import run_repository, series
from server.participation.answer_schemas import NextTrials, Receipt, SeriesPosition, TrialClip, TrialInfo
from server.participation.current_run import find_run
from server.participation.rating_repository import refused_trials
from server.participation.refusals import GroupRefused
from server.participation.run_repository import compared_answers
from server.participation.run_schemas import ShownCheck, ShownChecks, ShownOtherWay
from server.participation.series import Outlook
from server.participation.verdict import is_settled
from server.participation.versions import LoadedVersion, PlacedClip, Versions
from server.participation.view_repository import numbers
from server.participation.views import unanswered_views
from server.participation.warnings import in_language

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
    # Each origin separately: pilot runs must not take the places that people are recruited for.
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


# A run's trials as the page gets them: in stored order, with what is still to be shown of each.

_TOLD = ("clip_sha256", "frames", "fps")
_SIZE = ("width_px", "height_px", "width_mm", "inter_ocular_px")


def trial_list(session: Session, run: StudyRun, loaded: LoadedVersion) -> list[TrialInfo]:
    """Every trial of a run; nothing in it reveals to the participant which cell a clip is of."""
    done, begun = run_repository.plays(session, run), numbers(session, run)
    unanswered = unanswered_views(session, run) if begun else {}
    max_repeats = loaded.experiment.playback.max_repeats
    positions = _positions(session, run, loaded)
    refused = refused_trials(session.connection(), run.id)
    shown, clips = loaded.once(_FirstClips), loaded.once(_Clips)
    trials = []
    for row in run_repository.trials(session, run):
        index, kind, first = row.trial_index, row.kind, next(iter(row.clips.values()), None)
        plays = done.get(index, ())
        settled = any(is_settled(kind, play, verdict, max_repeats) for play, verdict in plays)
        position, closed = positions.get(index, (None, False))
        settled = settled or closed or index in refused
        trials.append(
            TrialInfo(
                trial_index=index,
                kind=kind,
                block=row.block,
                **shown[first],
                clips=[clips[role, clip] for role, clip in row.clips.items()],
                prompt=_prompt(loaded, run.language, row) if kind == "attention" else None,
                check=_check(loaded, first) if kind == "check" else None,
                plays_done=len(plays),
                plays_wanted=len(plays) if settled else len(plays) + 1,
                answered=settled,
                series=position,
                views_begun=begun.get(index, 0),
                views=[] if settled else unanswered.get(index, []),
            )
        )
    return trials


def _positions(
    session: Session, run: StudyRun, loaded: LoadedVersion
) -> dict[int, tuple[SeriesPosition, bool]]:
    """Position in its series of each trial that has one, and whether that series ended before it."""
    if not KINDS[loaded.experiment.trial.kind].adapts:
        return {}
    return {
        index: (SeriesPosition(number=number, position=position, known=known), closed)
        for index, number, position, known, closed in series.places(session.connection(), run.id, loaded)
    }


class _FirstClips(dict[int | None, dict[str, Any]]):
    """What a trial says of its first clip, by the clip's id; under None the nulls of a trial without clips.

    As with `_Clips`: made when a clip is first shown, and kept with its version, which never changes.
    """

    def __init__(self, loaded: LoadedVersion) -> None:
        super().__init__({None: dict.fromkeys((*_TOLD, *_SIZE))})
        self.loaded = loaded

    def __missing__(self, ident: int) -> dict[str, Any]:
        clip = self.loaded.clips[ident]
        told = {name: getattr(clip, name) for name in _SIZE if name != "inter_ocular_px"}
        self[ident] = _clip_info(clip) | told | {"inter_ocular_px": self.loaded.inter_ocular_px}
        return self[ident]


class _Clips(dict[tuple[str, int], TrialClip]):
    """Every clip of a version as the page gets it, by role and id."""

    def __init__(self, loaded: LoadedVersion) -> None:
        super().__init__()
        self.loaded = loaded

    def __missing__(self, shown: tuple[str, int]) -> TrialClip:
        role, ident = shown
        self[shown] = TrialClip.model_validate({"role": role, **_clip_info(self.loaded.clips[ident])})
        return self[shown]


def _clip_info(clip: PlacedClip) -> dict[str, Any]:
    return {"clip_sha256": clip.sha256, "frames": clip.frames, "fps": clip.fps}


def _check(loaded: LoadedVersion, clip: int | None) -> CheckName | None:
    return None if clip is None else loaded.check_of(clip).check


def _prompt(loaded: LoadedVersion, language: str, row: run_repository.StoredTrial) -> str:
    """The answer that an attention check wants; the right answer of a motion check is never sent."""
    texts = loaded.experiment.attention.text
    text = texts.get(language) or texts.get("en") or next(iter(texts.values()))
    return text.replace("{response}", str(row.expected_response))


# What an answer changes of the trials to come, sent with its receipt.

log = logging.getLogger("palpebra")


def next_trials(
    database: Database, versions: Versions, token: str, receipt: Receipt
) -> tuple[Receipt, NextTrials | None]:
    """The receipt with what remains once ended series are closed, and the trials chosen again."""
    outlook = follow(database, versions, token)
    if outlook is None:
        return receipt, None
    offered = {offer.trial_index for offer in outlook.offers}
    with database.read() as session:
        run = find_run(session, token)
        every = trial_list(session, run, versions.get(session, run.version_id))
    trials = [trial for trial in every if trial.trial_index in offered]
    receipt = receipt.model_copy(update={"remaining": outlook.remaining})
    return receipt, NextTrials(trials=trials, closed=list(outlook.closed))


def follow(database: Database, versions: Versions, token: str) -> Outlook | None:
    """Bring a run's series up to its answers. What fails here is logged and done again with the next answer.

    The answer itself is stored by then, and its receipt must not be lost to a choice that could not be made.
    """
    try:
        return series.follow_series(database, versions, token)
    except Exception:
        log.exception("the series of a run could not be followed; its page goes on with what it has")
        return None


# What the page gets of a study's motion checks: questions and choices, never an answer.


def shown_checks(experiment: Experiment, language: str) -> ShownChecks | None:
    """The words of the declared checks in the run's language; None where there are no checks."""
    declared = experiment.evidence.motion_checks
    if not any(motion_checks_by_block(experiment)):
        return None
    other = declared.other_way
    said = (
        {
            name: in_language(text, language, experiment.languages)
            for name, text in (("label", other.label), ("text", other.text))
        }
        if other
        else None
    )
    return ShownChecks(
        by_kind={kind: _shown_check(experiment, kind, language) for kind in declared.kinds},
        other_way=ShownOtherWay.model_validate(said) if said else None,
    )


def _shown_check(experiment: Experiment, kind: CheckName, language: str) -> ShownCheck:
    wording = experiment.evidence.motion_checks.wording
    words = next((words for words in wording if words.check == kind), None) or CHECK_KINDS[kind]
    return ShownCheck(
        question=in_language(words.question, language, experiment.languages),
        choices=[in_language(choice, language, experiment.languages) for choice in words.choices],
    )
