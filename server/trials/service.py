"""Store a rating once, judge its playback, and write the receipt."""

from datetime import datetime
from typing import Any

from sqlalchemy import Connection

from server.errors import Conflict, Invalid
from server.evidence.intake import Intake
from server.tallies.tally import Tally
from server.trials import checks, repository, warnings
from server.trials.attention import by_attention
from server.trials.delivery import Delivery, delivery_of, evidence_of, play_of, row_of
from server.trials.kinds import served
from server.trials.refusals import ConsentMissing, RunClosed
from server.trials.schemas import RatingIn, Receipt, RunStatus
from server.trials.series import service as series
from server.trials.verdict import Ruling
from server.versions import Versions


class PlayOutOfRange(Invalid):
    """A clip may not be shown as often as this."""

    code = "play_out_of_range"


class RatingDiffers(Conflict):
    """Another value is stored under this id, or for this play."""

    code = "rating_differs"


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
    known = _known(delivery)
    if known is not None:
        return _receipt_of_known(connection, delivery, known), False
    _check(delivery)
    tally = delivery.trial.tally or Tally()
    if delivery.run.evidence == "asked":
        tally.clip_time = intake.take(connection, evidence_of(delivery), tally.clip_time)
    ruling = _judged(delivery)
    repository.add_rating(connection, row_of(delivery, ruling))
    tally.add(play_of(delivery, ruling))
    repository.keep_tally(connection, delivery.run.id, tally, is_new=delivery.trial.tally is None)
    return _receipt_of_new(connection, delivery, ruling), True


def _known(delivery: Delivery) -> repository.StoredRating | None:
    """The stored rating this one repeats; RatingDiffers where it says something else."""
    rating, payload = delivery.rating, delivery.payload
    for row in delivery.stored:
        same_play = (row.trial_index, row.play) == (rating.trial_index, rating.play)
        if row.rating_id != delivery.rating_id and not same_play:
            continue
        if same_play and row.payload == payload:
            return row
        raise RatingDiffers(
            f"Trial {row.trial_index}, play {row.play} is stored with the answer {_short(row.payload)}; "
            f"got {_short(payload)} for trial {rating.trial_index}, play {rating.play}. The first is kept.",
            stored={"trial_index": row.trial_index, "play": row.play, "answer": row.payload},
        )
    return None


def _short(answer: dict[str, Any]) -> Any:
    return next(iter(answer.values()))


def _receipt_of_known(connection: Connection, delivery: Delivery, known: repository.StoredRating) -> Receipt:
    run = delivery.run
    return Receipt(
        rating_id=delivery.rating_id,
        saved_at=known.saved_at,
        verdict=known.verdict,
        rule=known.verdict_rule,
        again=not delivery.settles(known.play, known.verdict),
        remaining=run.trials_total - run.trials_answered,
        status=run.status,
        warning=warnings.warning_of(connection, run.id, delivery.experiment, known.rating_id),
    )


def _check(delivery: Delivery) -> None:
    run, rating, experiment = delivery.run, delivery.rating, delivery.experiment
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")
    if delivery.trial.kind == "check":
        checks.validate(delivery.loaded, delivery.trial.clips, rating)
    else:
        served(experiment.trial.kind).validate(experiment, delivery.trial.kind, rating)
    max_plays = experiment.playback.max_repeats + 1
    if rating.play > max_plays:
        raise PlayOutOfRange(f"A clip is shown at most {max_plays} times, got play {rating.play}.")


def _judged(delivery: Delivery) -> Ruling:
    is_check = delivery.trial.kind == "check"
    judge = checks.judge if is_check else served(delivery.experiment.trial.kind).judge
    return judge(delivery.loaded, delivery.trial.clips, delivery.rating)


def _receipt_of_new(connection: Connection, delivery: Delivery, ruling: Ruling) -> Receipt:
    """Carry the answer into its series and its run, and say what follows from it."""
    run, rating = delivery.run, delivery.rating
    settles, before = delivery.settles(rating.play, ruling[0]), delivery.was_settled
    if delivery.adapts and series.take(connection, run.id, delivery.loaded, delivery.trial, rating, ruling):
        before = True
    answered = int(settles and not before)
    elapsed = max(run.elapsed_ms, rating.time_elapsed or 0.0)
    repository.mark_seen(connection, run.id, delivery.saved_at, elapsed, answered)
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


def _consequence(connection: Connection, delivery: Delivery) -> warnings.Lapse:
    """What an answer means for the run beside itself: a failed check may end it, a careless one be told."""
    run, experiment = delivery.run.id, delivery.experiment
    if delivery.trial.kind == "attention":
        return warnings.Lapse(None, ends=by_attention(connection, run, experiment))
    if delivery.trial.kind == "main":
        return warnings.after_answer(connection, run, experiment, delivery.rating_id, delivery.saved_at)
    return warnings.NO_LAPSE
