"""Records that can never be stored as what they were sent as: kept with the reason, never asked for again.

A page that asked for such a record again and again would hold its participant for ever. The server checks it
once more, stores it where it can, and otherwise keeps it as refused: the run can be completed, and the
experimenter reads why. The rules of evidence hold as for every answer, so that nobody gets a completion code
for trials that were not watched.
"""

import json
from datetime import datetime
from math import isfinite
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Connection

from server.core.errors import Conflict
from server.core.values import hash_token
from server.participation import rating_repository
from server.participation.answer_schemas import Part, RatingEvidence, RefusedRecord
from server.participation.intake import Intake
from server.participation.ratings import answer_to
from server.participation.refusals import ConsentMissing, RunClosed, RunUnknown, TrialNotInRun
from server.participation.tallies import Tally
from server.participation.versions import Versions
from server.participation.warnings import by_attention

KEPT_BYTES = 32 * 1024
MAX_DEPTH = 16
"""Levels of nesting that are kept, more than a page's record has."""
MAX_REFUSED = 2_000
"""More than a run has trials and views."""
MAX_WHOLE = 100
"""The first of a run are kept whole, of further ones the reason alone: all are read with each answer."""


class TooManyRefused(Conflict, code="too_many_refused"):
    """A run has as many refused records as are kept."""


def keep_refused(
    versions: Versions,
    intake: Intake,
    connection: Connection,
    token: str,
    record: RefusedRecord,
    received_at: datetime,
) -> None:
    """Keep a record as refused, once; it must bring the evidence that an accepted one would need."""
    run = rating_repository.run_for_rating(connection, hash_token(token))
    if run is None:
        raise RunUnknown("This visit is unknown. Please open your link again.")
    if rating_repository.is_refused(connection, run.id, str(record.id)):
        return
    if run.consented_at is None:
        raise ConsentMissing("Nothing is stored before the participant has agreed; send the consent first.")
    before = rating_repository.refused_records(connection, run.id)
    if len(before) >= MAX_REFUSED:
        raise TooManyRefused(f"This visit has {MAX_REFUSED} refused records; no more are kept.")
    which = record.which
    part = None
    if which is not None:
        known = any((one.get("trial_index"), one.get("play")) == which for one in before)
        part = _check_answer(versions, intake, connection, run, record, received_at, known=known)
    kept = _kept_record(record, which, whole=len(before) < MAX_WHOLE)
    rating_repository.add_event(
        connection, run.id, str(record.id), rating_repository.REFUSED, kept, received_at
    )
    if part == "attention":  # it counts as failed, as for an answer that is stored
        by_attention(connection, run.id, versions.get(connection, run.version_id).experiment)


def _check_answer(
    versions: Versions,
    intake: Intake,
    connection: Connection,
    run: rating_repository.RunForRating,
    record: RefusedRecord,
    received_at: datetime,
    *,
    known: bool,
) -> Part:
    """Refuse what no answer could be: of a run that is over, of no trial, or without its evidence.

    The part of the run that its trial is of; evidence is asked for once (`known`).
    """
    which = record.which or (0, 1)
    trial_index = which[0]
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    trial = rating_repository.trial(connection, run.id, trial_index)
    if trial is None:
        raise TrialNotInRun(f"Trial {trial_index} is not in this run, which has {run.trials_total} trials.")
    if run.evidence != "asked" or known:
        return trial.kind
    tally = trial.tally or Tally()
    answer = answer_to(
        run,
        trial,
        versions.get(connection, run.version_id),
        which,
        received_at,
        # What the refused record says of its play counts for nothing: its clips must have been there in time.
        rated=bool(trial.clips),
        is_check=trial.kind == "check",
        answered_at=None,
        evidence=_evidence(record.body),
    )
    # Its clips take their time although nothing is stored: a page must not gain time by refusals.
    tally.clip_time = intake.take(connection, answer, tally.clip_time, stores=False)
    rating_repository.keep_tally(connection, run.id, tally, is_new=trial.tally is None)
    return trial.kind


def _evidence(body: dict[str, Any]) -> RatingEvidence | None:
    sent = body.get("evidence")
    if not isinstance(sent, dict):
        return None
    try:
        # Without the presses: a fault in them must not hide a good ticket.
        return RatingEvidence.model_validate({**sent, "interaction": None})
    except ValidationError:
        return None


def _kept_record(record: RefusedRecord, which: tuple[int, int] | None, *, whole: bool) -> dict[str, Any]:
    """What is stored: the reason and the record, without what would not fit."""
    body = _storable_value({key: value for key, value in record.body.items() if key != "evidence"})
    if _size(body) > KEPT_BYTES and isinstance(body.get("playback"), dict):
        # The log of drawn frames goes first, as the longest part of a record.
        body["playback"] = {key: value for key, value in body["playback"].items() if key != "drawn"}
    if _size(body) > KEPT_BYTES or not whole:
        body = {"left_out_bytes": _size(body)}
    told = {"path": record.path, "status": record.status, "code": record.code, "reason": record.message}
    where = {} if which is None else {"trial_index": which[0], "play": which[1]}
    return {**_storable_value(told), **where, "record": body}


def _storable_value(value: Any, levels: int = MAX_DEPTH) -> Any:
    """The same without what no database holds: numbers beyond all bounds, NUL, half characters, depth."""
    if isinstance(value, dict | list) and not levels:
        return None
    if isinstance(value, dict):
        return {_storable_value(str(key)): _storable_value(one, levels - 1) for key, one in value.items()}
    if isinstance(value, list):
        return [_storable_value(one, levels - 1) for one in value]
    if isinstance(value, str):
        return value.replace("\0", "").encode("utf-8", "replace").decode("utf-8")
    return None if isinstance(value, float) and not isfinite(value) else value


def _size(body: dict[str, Any]) -> int:
    return len(json.dumps(body))
