"""The judgement on a stored run."""

import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from experiments.trials import KINDS
from server.evidence import repository
from server.evidence.signals import JudgedAnswer
from server.evidence.verdict import NOT_JUDGED, Judgement, judge
from server.models import StudyRun


def judge_run(session: Session, run: StudyRun) -> Judgement:
    """The judgement on a run as it is stored; runs whose page was not asked for evidence are not judged."""
    if run.evidence != "asked" or run.erased_at is not None:
        return NOT_JUDGED
    answers = [_answer(row) for row in repository.answers(session, run)]
    return judge(answers, refused=repository.has_refusals(session, run))


def _answer(row: repository.StoredAnswer) -> JudgedAnswer:
    evidence, trial = row.evidence, row.trial
    response = _response(row.rating.payload)
    if trial.kind == "attention":
        response = KINDS[row.rating.kind].check_response(row.rating.payload)
    given = (evidence.interaction if evidence else None) or {}
    unchecked = evidence is not None and evidence.digest is not None and evidence.digest_right is None
    return JudgedAnswer(
        trial_index=trial.trial_index,
        play=row.rating.play,
        part=trial.kind,
        response=response,
        expected=trial.expected_response,
        rt=row.rating.rt,
        clip_ms=evidence.clip_ms if evidence else 0.0,
        needs_digest=response is not None and row.has_clip and not unchecked,
        received_at=evidence.received_at if evidence else row.rating.saved_at,
        issued_at=evidence.issued_at if evidence else None,
        digest_right=evidence.digest_right if evidence else None,
        late=bool(evidence and evidence.late),
        presses=given.get("presses"),
        trusted=given.get("trusted"),
        press_ms=given.get("press_ms"),
    )


def _response(payload: Mapping[str, Any]) -> int | str | None:
    """An answer of any kind as one value that can be compared; None where nothing was answered."""
    said = {name: _without_time(value) for name, value in payload.items() if value is not None}
    if said.keys() == {"response"}:
        return said["response"] if isinstance(said["response"], int) else str(said["response"])
    scales = payload.get("answers", {}).values()
    if scales and all(one["response"] is None and not one.get("not_applicable") for one in scales):
        return None
    return json.dumps(said, sort_keys=True) if said else None


def _without_time(value: Any) -> Any:
    """An answer on several scales without the times that each took: equal answers must be equal."""
    if not isinstance(value, dict):
        return value
    return {name: {**one, "rt": None} if isinstance(one, dict) else one for name, one in value.items()}
