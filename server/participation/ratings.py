"""Store a rating once, judge its playback, and write the receipt."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection

from experiments.checks import CHECK_KINDS
from experiments.declaration.any_trial import CheckAnswer
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from server.core.errors import Conflict, Invalid
from server.core.values import hash_token
from server.participation import rating_repository, series, warnings
from server.participation.answer_schemas import (
    RatingEvidence,
    RatingIn,
    Receipt,
    RunStatus,
    ShownClips,
    Verdict,
)
from server.participation.intake import TRIED_MS, Answer, Intake
from server.participation.kinds import answer_of, served_kind
from server.participation.refusals import ConsentMissing, RunClosed, RunUnknown, TrialNotInRun
from server.participation.tallies import Play, Tally, TallyEntry
from server.participation.verdict import Ruling, is_settled, playback_of
from server.participation.verdict import judge as judge_play
from server.participation.versions import LoadedVersion, Versions
from server.participation.warnings import by_attention

# A rating as it came, with the run, the trial and the version it is for, and the rows that keep it.


@dataclass(frozen=True)
class SubmittedRating:
    """A rating under its id, what it is for, and the ratings of this trial or id that are stored.

    Its payload is the answer as it is stored.
    """

    rating_id: str
    rating: RatingIn
    payload: dict[str, Any]
    saved_at: datetime
    run: rating_repository.RunForRating
    trial: rating_repository.StoredTrial
    loaded: LoadedVersion
    stored: list[rating_repository.StoredRating]

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
) -> SubmittedRating:
    """Look up what a rating is for; RunUnknown or TrialNotInRun where there is no such thing."""
    run = rating_repository.run_for_rating(connection, hash_token(token))
    if run is None:
        raise RunUnknown("This visit is unknown. Please open your link again.")
    trial = rating_repository.trial(connection, run.id, rating.trial_index)
    if trial is None:
        raise TrialNotInRun(
            f"Trial {rating.trial_index} is not in this run, which has trials 0 to {run.trials_total - 1}."
        )
    loaded = versions.get(connection, run.version_id)
    # The clip may have been chosen again since: what counts is the one that the page has shown.
    if KINDS[loaded.experiment.trial.kind].adapts:
        trial = series.as_offered(connection, run.id, trial, rating)
    stored = rating_repository.stored_ratings(connection, run.id, rating.trial_index, rating_id)
    return SubmittedRating(rating_id, rating, rating.answer.stored(), saved_at, run, trial, loaded, stored)


def row_of(delivery: SubmittedRating, ruling: Ruling) -> dict[str, Any]:
    """The rating's row."""
    rating, run = delivery.rating, delivery.run
    playback = dict(rating.playback)
    # The logs of several clips are in a column of JSON; every other key of the log has its own column.
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


def play_of(delivery: SubmittedRating, ruling: Ruling) -> Play:
    """What the run's tally counts of it."""
    rating, loaded, trial = delivery.rating, delivery.loaded, delivery.trial
    is_main = trial.kind == "main"
    counted: Iterable[TallyEntry] = ()
    if is_main:
        # Numbers within the version instead of ids: a tally packs them into 18 bits.
        places = {role: loaded.numbered[clip] for role, clip in trial.clips.items()}
        counted = served_kind(loaded.experiment.trial.kind).counted(places, delivery.payload)
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


def evidence_of(delivery: SubmittedRating) -> Answer:
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
    run: rating_repository.RunForRating,
    trial: rating_repository.StoredTrial,
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
    # A motion check shows its one clip whatever the study's kind: the kind's own timing is not for it.
    shown_ms = max(lengths.values(), default=0.0) if is_check else loaded.experiment.trial.shown_ms(lengths)
    # A motion check that was passed over was not begun.
    tried_ms = 0.0 if is_check else min(shown_ms, TRIED_MS)
    return Answer(
        run=run.id,
        run_id=run.public_id,
        origin=run.origin,
        trial_index=which[0],
        play=which[1],
        rated=rated,
        clips=tuple((clip.sha256, clip.bytes) for clip in clips),
        clip_ms=shown_ms if rated else tried_ms,
        trials=run.trials_total,
        received_at=received_at,
        answered_at=answered_at,
        evidence=evidence,
    )


def with_zone(moment: datetime | None) -> datetime | None:
    """A page's moment, as UTC where it names no zone."""
    return moment if moment is None or moment.tzinfo else moment.replace(tzinfo=UTC)


# Motion checks: what may be answered, and whether their clip was shown; studies of every kind have them.


class NoSuchChoice(Invalid, code="no_such_choice"):
    """The check has no such choice."""


class NoOtherWay(Invalid, code="no_other_way"):
    """The study offers no way around its checks."""


def validate_check(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> None:
    """Refuse an answer of another kind, a choice that is not offered, and a way around that is not."""
    answer = answer_of(rating, CheckAnswer)
    choices = len(CHECK_KINDS[loaded.check_of(clips["shown"]).check].choices)
    if answer.check is not None and answer.check > choices:
        raise NoSuchChoice(f"Expected a choice from 1 to {choices}, got {answer.check}.")
    if answer.other_way and loaded.experiment.evidence.motion_checks.other_way is None:
        raise NoOtherWay("Expected one of the choices; this study offers no other way.")


def judge_check(loaded: LoadedVersion, clips: Mapping[str, int], rating: RatingIn) -> Ruling:
    """The verdict on the play of the check's clip."""
    clip = loaded.clips[clips["shown"]]
    playback = playback_of(rating.playback)
    rated = rating.answer.given
    return judge_play(loaded.experiment.playback, playback, clip.sha256, clip.frames, clip.fps, rated=rated)


# Store a rating once, judge its playback, and write the receipt.


class PlayOutOfRange(Invalid, code="play_out_of_range"):
    """A clip may not be shown as often as this."""


class RatingDiffers(Conflict, code="rating_differs"):
    """Another value is stored under this id, or for this play."""


def save_rating(
    versions: Versions,
    intake: Intake,
    connection: Connection,
    token: str,
    rating_id: str,
    rating: RatingIn,
    saved_at: datetime,
) -> tuple[Receipt, bool]:
    """Store a rating with its evidence, or find it stored; return the receipt and whether it is new."""
    delivery = delivery_of(versions, connection, token, rating_id, rating, saved_at)
    known = _known_rating(delivery)
    # Before any check: a rating that is stored gets the same receipt for ever, also after the visit is
    # over.
    if known is not None:
        return _receipt_of_known(connection, delivery, known), False
    _check(delivery)
    # Read with the trial in one query, and written below in the same transaction.
    tally = delivery.trial.tally or Tally()
    if delivery.run.evidence == "asked":
        tally.clip_time = intake.take(connection, evidence_of(delivery), tally.clip_time)
    # After the evidence: what is refused needs no verdict.
    ruling = _ruling_of(delivery)
    # Row and tally in one transaction: results are read from tallies, and must never count a row that is
    # not there.
    rating_repository.add_rating(connection, row_of(delivery, ruling))
    tally.add(play_of(delivery, ruling))
    rating_repository.keep_tally(connection, delivery.run.id, tally, is_new=delivery.trial.tally is None)
    return _receipt_of_new(connection, delivery, ruling), True


def _known_rating(delivery: SubmittedRating) -> rating_repository.StoredRating | None:
    """The stored rating this one repeats; RatingDiffers where it says something else."""
    rating, payload = delivery.rating, delivery.payload
    for row in delivery.stored:
        same_play = (row.trial_index, row.play) == (rating.trial_index, rating.play)
        # Two keys, either of which marks a repetition: the id, and the play of the trial.
        if row.rating_id != delivery.rating_id and not same_play:
            continue
        if same_play and row.payload == payload:
            return row
        raise RatingDiffers(
            f"Trial {row.trial_index}, play {row.play} is stored with the answer {_first_value(row.payload)}"
            f"; got {_first_value(payload)} for trial {rating.trial_index}, play {rating.play}. "
            "The first is kept.",
            stored={"trial_index": row.trial_index, "play": row.play, "answer": row.payload},
        )
    return None


def _first_value(answer: dict[str, Any]) -> Any:
    return next(iter(answer.values()))


def _receipt_of_known(
    connection: Connection, delivery: SubmittedRating, known: rating_repository.StoredRating
) -> Receipt:
    run = delivery.run
    return Receipt(
        rating_id=delivery.rating_id,
        saved_at=known.saved_at,
        verdict=known.verdict,
        rule=known.verdict_rule,
        again=not delivery.settles(known.play, known.verdict),
        # From the run as it is now: other answers may have been stored since the first receipt.
        remaining=run.trials_total - run.trials_answered,
        status=run.status,
        warning=warnings.warning_of(connection, run.id, delivery.experiment, known.rating_id),
    )


def _check(delivery: SubmittedRating) -> None:
    run, rating, experiment = delivery.run, delivery.rating, delivery.experiment
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")
    if delivery.trial.kind == "check":
        validate_check(delivery.loaded, delivery.trial.clips, rating)
    else:
        served_kind(experiment.trial.kind).validate(experiment, delivery.trial.kind, rating)
    max_plays = experiment.playback.max_repeats + 1
    if rating.play > max_plays:
        raise PlayOutOfRange(f"A clip is shown at most {max_plays} times, got play {rating.play}.")


def _ruling_of(delivery: SubmittedRating) -> Ruling:
    is_check = delivery.trial.kind == "check"
    judge = judge_check if is_check else served_kind(delivery.experiment.trial.kind).judge
    return judge(delivery.loaded, delivery.trial.clips, delivery.rating)


def _receipt_of_new(connection: Connection, delivery: SubmittedRating, ruling: Ruling) -> Receipt:
    """Carry the answer into its series and its run, and say what follows from it."""
    run, rating = delivery.run, delivery.rating
    settles, before = delivery.settles(rating.play, ruling[0]), delivery.was_settled
    if delivery.adapts and series.take_answer(
        connection, run.id, delivery.loaded, delivery.trial, rating, ruling
    ):
        # The end of its series has counted this trial already (`close_trials`).
        before = True
    # A second play of a settled trial is stored, but the trial is answered once.
    answered = int(settles and not before)
    # Answers of an outbox may come out of order: time must not run backwards.
    elapsed = max(run.elapsed_ms, rating.time_elapsed or 0.0)
    rating_repository.mark_seen(connection, run.id, delivery.saved_at, elapsed, answered)
    lapse = _consequence(connection, delivery)
    status: RunStatus = "screened_out" if lapse.ends else run.status
    return Receipt(
        rating_id=delivery.rating_id,
        saved_at=delivery.saved_at,
        verdict=ruling[0],
        rule=ruling[1],
        again=not settles and not before,
        remaining=run.trials_total - run.trials_answered - answered,
        status=status,
        warning=lapse.warning,
    )


def _consequence(connection: Connection, delivery: SubmittedRating) -> warnings.Lapse:
    """What else an answer means for the run: a failed check may end it, a careless one get a warning."""
    run, experiment = delivery.run.id, delivery.experiment
    if delivery.trial.kind == "attention":
        return warnings.Lapse(None, ends=by_attention(connection, run, experiment))
    if delivery.trial.kind == "main":
        return warnings.after_answer(connection, run, experiment, delivery.rating_id, delivery.saved_at)
    return warnings.NO_LAPSE
