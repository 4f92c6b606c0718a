"""A rating as it came, with the run, the trial and the version it is for, and the rows that keep it."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection

from experiments.definition import Experiment
from experiments.trials import KINDS
from experiments.trials.check import CheckAnswer
from server.errors import NotFound
from server.evidence.intake import Answer
from server.evidence.schemas import RatingEvidence
from server.tallies.tally import Counted, Play
from server.tokens import hash_token
from server.trials import repository
from server.trials.kinds import served
from server.trials.refusals import RunUnknown
from server.trials.schemas import RatingIn, ShownClips
from server.trials.series import service as series
from server.trials.verdict import Ruling, Verdict, is_settled
from server.versions import LoadedVersion, Versions


class TrialNotInRun(NotFound):
    """The run has no such trial."""

    code = "trial_not_in_run"


@dataclass(frozen=True)
class Delivery:
    """A rating under its id, what it is for, and the ratings of this trial or id that are stored.

    Its payload is the answer as it is stored.
    """

    rating_id: str
    rating: RatingIn
    payload: dict[str, Any]
    saved_at: datetime
    run: repository.RunForRating
    trial: repository.StoredTrial
    loaded: LoadedVersion
    stored: list[repository.StoredRating]

    @property
    def experiment(self) -> Experiment:
        """The declaration that the run was begun with."""
        return self.loaded.experiment

    @property
    def adapts(self) -> bool:
        """Whether the answers choose what is shown next."""
        return KINDS[self.experiment.trial.kind].adapts

    def settles(self, play: int, verdict: Verdict) -> bool:
        """Whether a play with this verdict ends its trial."""
        return is_settled(self.trial.kind, play, verdict, self.experiment.playback.max_repeats)

    @property
    def was_settled(self) -> bool:
        """Whether an earlier play had ended the trial."""
        return any(self.settles(row.play, row.verdict) for row in self.stored)


def delivery_of(
    versions: Versions,
    connection: Connection,
    token: str,
    rating_id: str,
    rating: RatingIn,
    saved_at: datetime,
) -> Delivery:
    """Look up what a rating is for; RunUnknown or TrialNotInRun where there is no such thing."""
    run = repository.run_for_rating(connection, hash_token(token))
    if run is None:
        raise RunUnknown("This visit is not known; please open the link you were given again.")
    trial = repository.trial(connection, run.id, rating.trial_index)
    if trial is None:
        raise TrialNotInRun(
            f"Trial {rating.trial_index} is not in this run, which has trials 0 to {run.trials_total - 1}."
        )
    loaded = versions.get(connection, run.version_id)
    if KINDS[loaded.experiment.trial.kind].adapts:
        trial = series.as_offered(connection, run.id, trial, rating)
    stored = repository.stored_ratings(connection, run.id, rating.trial_index, rating_id)
    return Delivery(rating_id, rating, rating.answer.stored(), saved_at, run, trial, loaded, stored)


def row_of(delivery: Delivery, ruling: Ruling) -> dict[str, Any]:
    """The rating's row."""
    rating, run = delivery.rating, delivery.run
    playback = dict(rating.playback)
    clips: ShownClips | None = playback.pop("clips")
    return {
        "rating_id": delivery.rating_id,
        "study_run_id": run.id,
        "trial_index": rating.trial_index,
        "play": rating.play,
        "kind": delivery.experiment.trial.kind,
        "payload": delivery.payload,
        "rt": rating.rt,
        "rt_from_first_frame": rating.rt_from_first_frame,
        "time_elapsed": rating.time_elapsed,
        "changes": rating.changes,
        "comment": rating.comment,
        "answered_at_client": with_zone(rating.answered_at_client),
        **playback,
        "playback": clips and clips.model_dump(exclude_none=True),
        "focus_lost": None if rating.playback.focus_lost is None else rating.playback.focus_lost > 0,
        "px_per_mm": run.px_per_mm,
        "viewing_distance_mm": run.viewing_distance_mm,
        "verdict": ruling[0],
        "verdict_rule": ruling[1],
        "saved_at": delivery.saved_at,
    }


def play_of(delivery: Delivery, ruling: Ruling) -> Play:
    """What the run's tally counts of it."""
    rating, loaded, trial = delivery.rating, delivery.loaded, delivery.trial
    is_main = trial.kind == "main"
    counted: Iterable[Counted] = ()
    if is_main:
        places = {role: loaded.numbered[clip] for role, clip in trial.clips.items()}
        counted = served(loaded.experiment.trial.kind).counted(places, delivery.payload)
    playback = rating.playback
    return Play(
        rating.trial_index,
        is_main,
        *ruling,
        playback.method,
        rating.rt,
        playback.key_to_first_frame_ms,
        tuple(counted),
    )


def evidence_of(delivery: Delivery) -> Answer:
    """What judges whether a person answered."""
    rating = delivery.rating
    return answer_to(
        delivery.run,
        delivery.trial,
        delivery.loaded,
        (rating.trial_index, rating.play),
        delivery.saved_at,
        rated=rating.answer.given,
        is_check=isinstance(rating.answer, CheckAnswer),
        answered_at=with_zone(rating.answered_at_client),
        evidence=rating.evidence,
    )


def answer_to(
    run: repository.RunForRating,
    trial: repository.StoredTrial,
    loaded: LoadedVersion,
    which: tuple[int, int],
    received_at: datetime,
    *,
    rated: bool,
    is_check: bool,
    answered_at: datetime | None,
    evidence: RatingEvidence | None,
) -> Answer:
    """An answer to a trial as the evidence sees it; `which` is the trial's index and the play."""
    clips = [loaded.clips[ident] for ident in trial.clips.values()]
    lengths = {role: loaded.lengths[loaded.clips[ident].sha256] for role, ident in trial.clips.items()}
    shown_ms = max(lengths.values(), default=0.0) if is_check else loaded.experiment.trial.shown_ms(lengths)
    return Answer(
        run=run.id,
        run_id=run.public_id,
        origin=run.origin,
        trial_index=which[0],
        play=which[1],
        rated=rated,
        clips=tuple((clip.sha256, clip.bytes) for clip in clips),
        clip_ms=shown_ms * rated,
        received_at=received_at,
        answered_at=answered_at,
        evidence=evidence,
    )


def with_zone(moment: datetime | None) -> datetime | None:
    """A page's moment, as UTC where it names no zone."""
    return moment if moment is None or moment.tzinfo else moment.replace(tzinfo=UTC)
