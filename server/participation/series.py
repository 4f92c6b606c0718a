"""Follow the series of a run: from its stored answers to estimates, ends, and the next stimuli."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection

from experiments.assignment import Trial
from experiments.declaration.threshold import Stop, ThresholdAnswer, TwoInterval, threshold_of
from experiments.kinds.threshold_grid import (
    Model,
    Point,
    clip_of,
    exemplar_at,
    model,
    points,
    points_of,
    series_of,
    standard_of,
)
from server.core.db import Database
from server.models import StudyRun
from server.participation import quest, series_repository
from server.participation.answer_schemas import RatingIn
from server.participation.kinds import answer_of
from server.participation.quest import Answers, Estimate
from server.participation.rating_repository import StoredTrial, refused_trials
from server.participation.verdict import Ruling
from server.participation.versions import LoadedVersion, Versions


@dataclass(frozen=True)
class Offer:
    """A stimulus chosen for a trial.

    Attributes
    ----------
    clip : int
        Id of its clip.
    known : int
        Answers the choice rests on.
    """

    trial_index: int
    role: str
    known: int
    clip: int


@dataclass(frozen=True)
class Outlook:
    """What a run's answers lead to; `closed` and `remaining` are known once it is kept.

    Attributes
    ----------
    known : mapping of str to int
        Counting answers of each series when this was computed.
    estimates : mapping of (int, int) to Estimate
        By trial and play.
    closing : tuple of int
        Trials that a series leaves over by ending.
    closed : tuple of int
        Those, and the ones closed before.
    remaining : int
        Trials still to be answered.
    """

    known: Mapping[str, int]
    offers: tuple[Offer, ...]
    estimates: Mapping[tuple[int, int], Estimate]
    closing: tuple[int, ...]
    closed: tuple[int, ...] = ()
    remaining: int = 0


# Decision 0506: An adaptive series has no separate state.
def follow_series(database: Database, versions: Versions, token: str) -> Outlook | None:
    """Bring the series of a run up to its stored answers; None where other answers came meanwhile.

    This happens between two transactions, so that no other write waits for it. Doing it again changes
    nothing: equal answers give equal choices.
    """
    with database.read() as session:
        connection = session.connection()
        run = series_repository.run_of(connection, token)
        if run is None or run.status != "active":
            return None
        loaded = versions.get(connection, run.version_id)
        refused = refused_trials(connection, run.id)  # settled: nothing is chosen for them
        trials = [
            row for row in series_repository.trials(connection, run.id) if row.trial_index not in refused
        ]
        answers = series_repository.answers(connection, run.id)
    outlook = outlook_after(loaded, trials, answers)
    with database.write_connection() as connection:
        return _store_outlook(connection, token, outlook)


def outlook_after(loaded: LoadedVersion, trials: Sequence[Any], answers: Sequence[Any]) -> Outlook:
    """The outlook on the series that these trials make, after these answers. Pure."""
    experiment = loaded.experiment
    assumed, declared, levels = model(experiment), threshold_of(experiment), points(experiment)
    shown, known = loaded.once(_points), dict[str, int]()
    # Each series separately: its choices depend only on its own answers, as in separate experiments.
    offers: list[Offer] = []
    estimates: dict[tuple[int, int], Estimate] = {}
    closing: list[int] = []
    for one in series_of(experiment):
        given = [row for row in answers if row.series == one.name]
        said: Answers = tuple((shown[row.version_clip_id], row.positive) for row in given)
        known[one.name] = len(given)
        for number, row in enumerate(given, start=1):
            # An estimate that is stored stays: only answers since the last time lack one.
            if row.threshold is None:
                estimates[row.trial_index, row.play] = quest.estimate(assumed, said[:number])
        mine = [row for row in trials if row.series == one.name]
        waiting = [row for row in mine if row.plays == 0 and not row.closed]
        if waiting and is_certain_enough(declared.stop, assumed, said):
            closing += [row.trial_index for row in waiting]
            continue
        # One to be shown and those after it: the page has their clips before it needs them.
        next_ones = waiting[: declared.ahead + 1]
        chosen = quest.choices(assumed, said, len(next_ones))
        for row, stimulus in zip(next_ones, chosen, strict=True):
            clip = _clip(loaded, dict(one.levels), levels[stimulus], row.position)
            offers.append(Offer(row.trial_index, row.role, len(given), clip))
    return Outlook(known, tuple(offers), estimates, tuple(closing))


def is_certain_enough(stop: Stop, assumed: Model, said: Answers) -> bool:
    """Whether the estimate is as certain as the rule asks; the number of trials ends a series by itself."""
    if (stop.sd is None and stop.entropy is None) or len(said) < stop.at_least:
        return False
    reached = quest.estimate(assumed, said)
    sure = stop.sd is None or reached.threshold_sd <= stop.sd
    return sure and (stop.entropy is None or reached.entropy <= stop.entropy)


def _clip(loaded: LoadedVersion, levels: dict[str, str], stimulus: dict[str, str], position: int) -> int:
    """Id of the clip of this stimulus at this place of the series."""
    spec = clip_of(loaded.experiment, levels, stimulus, exemplar_at(loaded.experiment, position))
    return loaded.places[spec.cell, spec.exemplar]


def _store_outlook(connection: Connection, token: str, outlook: Outlook) -> Outlook | None:
    run = series_repository.run_of(connection, token, lock=True)
    now: dict[str, int] = dict.fromkeys(outlook.known, 0)
    for row in series_repository.answers(connection, run.id):
        now[row.series] += 1
    # Other answers came while this was computed: their own request brings the series up to date.
    if run.status != "active" or now != outlook.known:
        return None
    for (trial_index, play), estimate in outlook.estimates.items():
        series_repository.note_estimate(connection, run.id, trial_index, play, estimate._asdict())
    stored = series_repository.trials(connection, run.id)
    open_now = {row.trial_index for row in stored if row.plays == 0 and not row.closed}
    latest = series_repository.latest_offers(connection, run.id)
    new = [one for one in outlook.offers if one.trial_index in open_now and _is_new(one, latest)]
    series_repository.add_offers(
        connection,
        (
            {
                "study_run_id": run.id,
                "trial_index": one.trial_index,
                "known": one.known,
                "version_clip_id": one.clip,
            }
            for one in new
        ),
    )
    for one in new:
        series_repository.show_clip(connection, run.id, one.trial_index, one.role, one.clip)
    closing = [index for index in outlook.closing if index in open_now]
    if closing:
        series_repository.close_trials(connection, run.id, closing)
    remaining = run.trials_total - run.trials_answered - len(closing)
    # A trial that was played meanwhile stays open: its page must not get the message that it needs no answer.
    closed = (*(row.trial_index for row in stored if row.closed), *closing)
    return replace(outlook, closed=closed, remaining=remaining)


def _is_new(offer: Offer, latest: Mapping[int, int]) -> bool:
    # A choice that rests on no more answers than the stored one would be a step back.
    return offer.known > latest.get(offer.trial_index, -1)


def add_places(connection: Connection, run: StudyRun, loaded: LoadedVersion, trials: Sequence[Trial]) -> None:
    """Store which trial of a new run belongs to which series, and which of its clips is the stimulus."""
    counted: dict[str, int] = {}
    rows = []
    for index, trial in enumerate(trials):
        if not trial.shown:
            continue
        if trial.series:
            counted[trial.series] = counted.get(trial.series, 0) + 1
        rows.append(
            {
                "study_run_id": run.id,
                "trial_index": index,
                "series": trial.series or None,
                "position": counted.get(trial.series),
                "role": _stimulus_role(loaded, trial),
                "closed": False,
            }
        )
    series_repository.add_trials(connection, rows)


def _stimulus_role(loaded: LoadedVersion, trial: Trial) -> str:
    declared = threshold_of(loaded.experiment)
    standard, factor = standard_of(declared), declared.stimulus.factor
    return next(shown.role for shown in trial.shown if shown.clip.level(factor) != standard)


def places(connection: Connection, run: int, loaded: LoadedVersion) -> list[tuple[int, int, int, int, bool]]:
    """For each trial in a series: index, number of the series, position, answers known, whether closed."""
    numbers = {one.name: number for number, one in enumerate(series_of(loaded.experiment))}
    latest = series_repository.latest_offers(connection, run)
    return [
        (row.trial_index, numbers[row.series], row.position, latest.get(row.trial_index, 0), row.closed)
        for row in series_repository.trials(connection, run)
    ]


def as_offered(connection: Connection, run: int, trial: StoredTrial, rating: RatingIn) -> StoredTrial:
    """The trial with the clip that was offered from as many answers as the page says it knew of."""
    offered = series_repository.trial(connection, run, rating.trial_index)
    if offered is None or offered.series is None:
        return trial
    known = answer_of(rating, ThresholdAnswer).known
    clip = series_repository.offered_clip(connection, run, rating.trial_index, known)
    return trial if clip is None else trial._replace(clips={**trial.clips, offered.role: clip})


def take_answer(
    connection: Connection,
    run: int,
    loaded: LoadedVersion,
    trial: StoredTrial,
    rating: RatingIn,
    ruling: Ruling,
) -> bool:
    """Store what a play says to its series; return whether its trial had been closed before."""
    offered = series_repository.trial(connection, run, rating.trial_index)
    if offered is None:
        return False
    answer, clip = answer_of(rating, ThresholdAnswer), trial.clips[offered.role]
    before = series_repository.answers_in(connection, run, offered.series) if offered.series else 0
    two = isinstance(threshold_of(loaded.experiment).task, TwoInterval)
    right = answer.chosen == (offered.role if two else "yes") if answer.given else None
    counts = offered.series is not None and answer.given and ruling[0] != "failed"
    # The page's word, bounded: it cannot have known answers that were never given.
    known = min(answer.known, before)
    values = {
        "study_run_id": run,
        "trial_index": rating.trial_index,
        "play": rating.play,
        "version_clip_id": clip,
        "value": loaded.once(_points)[clip].value,
        "positive": right,
        "correct": right if counts else None,
        "counts": counts,
        "number": before + 1 if counts else None,
        "known": known,
        "ahead": before - known,
    }
    series_repository.add_answer(connection, values)
    series_repository.show_clip(connection, run, rating.trial_index, offered.role, clip)
    return bool(offered.closed)


def _points(loaded: LoadedVersion) -> dict[int, Point]:
    """The stimulus that each clip shows, by the clip's id; standards are none."""
    names = loaded.experiment.factor_names
    levels = {
        ident: dict(zip(names, cell.split("/"), strict=True)) for (cell, _), ident in loaded.places.items()
    }
    return points_of(loaded.experiment, levels)
