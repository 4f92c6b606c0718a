"""Store a rating once, judge its playback, and write the receipt."""

from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection

from experiments.definition import Experiment
from experiments.trials import KINDS
from experiments.trials.check import CheckAnswer
from server.errors import Conflict, Invalid, NotFound
from server.evidence.intake import Answer, Intake
from server.tallies.tally import Counted, Play, Tally
from server.tokens import hash_token
from server.trials import checks, repository, warnings
from server.trials.attention import by_attention
from server.trials.kinds import Part, served
from server.trials.refusals import ConsentMissing, RunClosed, RunUnknown
from server.trials.schemas import RatingIn, Receipt, RunStatus, ShownClips
from server.trials.series import service as series
from server.trials.verdict import Ruling, is_settled
from server.versions import LoadedVersion, Versions


class TrialNotInRun(NotFound):
    """The run has no such trial."""

    code = "trial_not_in_run"


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
    run = repository.run_for_rating(connection, hash_token(token))
    if run is None:
        raise RunUnknown("This visit is not known; please open the link you were given again.")
    trial = repository.trial(connection, run.id, rating.trial_index)
    if trial is None:
        raise TrialNotInRun(
            f"Trial {rating.trial_index} is not in this run, which has trials 0 to {run.trials_total - 1}."
        )
    loaded = versions.get(connection, run.version_id)
    adapts = KINDS[loaded.experiment.trial.kind].adapts
    if adapts:
        trial = series.as_offered(connection, run.id, trial, rating)
    stored = repository.stored_ratings(connection, run.id, rating.trial_index, rating_id)
    kind = loaded.experiment.trial.kind
    answer = rating.answer.stored()
    known = _known(stored, rating_id, rating, answer)
    max_repeats = loaded.experiment.playback.max_repeats
    if known is not None:
        again = not is_settled(trial.kind, known.play, known.verdict, max_repeats)
        left = run.trials_total - run.trials_answered
        ruling = (known.verdict, known.verdict_rule)
        receipt = _receipt(rating_id, known.saved_at, ruling, again, left, run.status)
        receipt.warning = warnings.warning_of(connection, run.id, loaded.experiment, known.rating_id)
        return receipt, False
    _check(run, loaded, trial, rating)
    tally = trial.tally or Tally()
    if run.evidence == "asked":
        given = _answer(run, loaded, trial, rating, saved_at)
        tally.clip_time = intake.take(connection, given, tally.clip_time)
    judge = checks.judge if trial.kind == "check" else served(kind).judge
    ruling = judge(loaded, trial.clips, rating)
    repository.add_rating(connection, _row(run, rating_id, kind, answer, rating, ruling, saved_at))
    tally.add(_play(loaded, trial, rating, answer, ruling))
    repository.keep_tally(connection, run.id, tally, is_new=trial.tally is None)
    settles = is_settled(trial.kind, rating.play, ruling[0], max_repeats)
    before = any(is_settled(trial.kind, row.play, row.verdict, max_repeats) for row in stored)
    if adapts and series.take(connection, run.id, loaded, trial, rating, ruling):
        before = True
    answered = int(settles and not before)
    elapsed = max(run.elapsed_ms, rating.time_elapsed or 0.0)
    repository.mark_seen(connection, run.id, saved_at, elapsed, answered)
    left = run.trials_total - run.trials_answered - answered
    warning, ended = _consequence(connection, run.id, loaded.experiment, trial.kind, rating_id, saved_at)
    status: RunStatus = "screened_out" if ended else run.status
    receipt = _receipt(rating_id, saved_at, ruling, not settles and not before, left, status)
    receipt.warning = warning
    return receipt, True


def _consequence(
    connection: Connection, run: int, experiment: Experiment, part: Part, rating_id: str, saved_at: datetime
) -> warnings.Lapse:
    """What an answer means for the run beside itself: a failed check may end it, a careless one be told."""
    if part == "attention":
        return warnings.Lapse(None, ends=by_attention(connection, run, experiment))
    if part == "main":
        return warnings.after_answer(connection, run, experiment, rating_id, saved_at)
    return warnings.NO_LAPSE


def _play(
    loaded: LoadedVersion,
    trial: repository.StoredTrial,
    rating: RatingIn,
    answer: dict[str, Any],
    ruling: Ruling,
) -> Play:
    is_main = trial.kind == "main"
    counted: Iterable[Counted] = ()
    if is_main:
        places = {role: loaded.numbered[clip] for role, clip in trial.clips.items()}
        counted = served(loaded.experiment.trial.kind).counted(places, answer)
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


def _known(
    stored: list[repository.StoredRating], rating_id: str, rating: RatingIn, answer: dict[str, Any]
) -> repository.StoredRating | None:
    """The stored rating this one repeats; RatingDiffers where it says something else."""
    for row in stored:
        same_play = (row.trial_index, row.play) == (rating.trial_index, rating.play)
        if row.rating_id != rating_id and not same_play:
            continue
        if same_play and row.payload == answer:
            return row
        raise RatingDiffers(
            f"Trial {row.trial_index}, play {row.play} is stored with the answer {_short(row.payload)}; "
            f"got {_short(answer)} for trial {rating.trial_index}, play {rating.play}. The first is kept.",
            stored={"trial_index": row.trial_index, "play": row.play, "answer": row.payload},
        )
    return None


def _short(answer: dict[str, Any]) -> Any:
    return next(iter(answer.values()))


def _check(
    run: repository.RunForRating, loaded: LoadedVersion, trial: repository.StoredTrial, rating: RatingIn
) -> None:
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")
    experiment = loaded.experiment
    if trial.kind == "check":
        checks.validate(loaded, trial.clips, rating)
    else:
        served(experiment.trial.kind).validate(experiment, trial.kind, rating)
    max_plays = experiment.playback.max_repeats + 1
    if rating.play > max_plays:
        raise PlayOutOfRange(f"A clip is shown at most {max_plays} times, got play {rating.play}.")


def _answer(
    run: repository.RunForRating,
    loaded: LoadedVersion,
    trial: repository.StoredTrial,
    rating: RatingIn,
    received_at: datetime,
) -> Answer:
    rated = rating.answer.given
    clips = [loaded.clips[ident] for ident in trial.clips.values()]
    lengths = {role: loaded.lengths[loaded.clips[ident].sha256] for role, ident in trial.clips.items()}
    is_check = isinstance(rating.answer, CheckAnswer)
    shown_ms = max(lengths.values(), default=0.0) if is_check else loaded.experiment.trial.shown_ms(lengths)
    return Answer(
        run=run.id,
        run_id=run.public_id,
        origin=run.origin,
        trial_index=rating.trial_index,
        play=rating.play,
        rated=rated,
        clips=tuple((clip.sha256, clip.bytes) for clip in clips),
        clip_ms=shown_ms * rated,
        received_at=received_at,
        answered_at=_with_zone(rating.answered_at_client),
        evidence=rating.evidence,
    )


def _with_zone(moment: datetime | None) -> datetime | None:
    return moment if moment is None or moment.tzinfo else moment.replace(tzinfo=UTC)


def _row(
    run: repository.RunForRating,
    rating_id: str,
    kind: str,
    answer: dict[str, Any],
    rating: RatingIn,
    ruling: Ruling,
    saved_at: datetime,
) -> dict[str, Any]:
    playback = dict(rating.playback)
    clips: ShownClips | None = playback.pop("clips")
    return {
        "rating_id": rating_id,
        "study_run_id": run.id,
        "trial_index": rating.trial_index,
        "play": rating.play,
        "kind": kind,
        "payload": answer,
        "rt": rating.rt,
        "rt_from_first_frame": rating.rt_from_first_frame,
        "time_elapsed": rating.time_elapsed,
        "changes": rating.changes,
        "comment": rating.comment,
        "answered_at_client": _with_zone(rating.answered_at_client),
        **playback,
        "playback": clips and clips.model_dump(exclude_none=True),
        "focus_lost": None if rating.playback.focus_lost is None else rating.playback.focus_lost > 0,
        "px_per_mm": run.px_per_mm,
        "viewing_distance_mm": run.viewing_distance_mm,
        "verdict": ruling[0],
        "verdict_rule": ruling[1],
        "saved_at": saved_at,
    }


def _receipt(
    rating_id: str, saved_at: datetime, ruling: Ruling, again: bool, remaining: int, status: RunStatus
) -> Receipt:
    return Receipt(
        rating_id=rating_id,
        saved_at=saved_at,
        verdict=ruling[0],
        rule=ruling[1],
        again=again,
        remaining=remaining,
        status=status,
    )
