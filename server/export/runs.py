"""Runs as CSV rows, and everything stored as JSON lines; one run is in memory at a time."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from experiments.columns.form_columns import FormColumn, run_columns
from server.clock import iso
from server.evidence.service import judge_run
from server.export import repository
from server.export.extract import Extract
from server.models import NO_SLOT, Study, StudyRun
from server.runs import service
from server.runs.repository import calibrations


def run_rows(
    session: Session, study: Study, extract: Extract, forms: Sequence[FormColumn]
) -> Iterator[list[Any]]:
    """Rows of the runs CSV in the order the runs began: the columns of `run_columns(forms)`."""
    names = [column.name for column in run_columns(forms)]
    name = study.name
    for run in repository.each_run(session, study, extract):
        values = _values(session, run, forms) | {"study": name}
        yield [values[column] for column in names]


def _values(session: Session, run: StudyRun, forms: Sequence[FormColumn]) -> dict[str, Any]:
    answers = repository.answers_by_form(session, run)
    return {
        "run": run.public_id,
        "participant": run.participant,
        "phase": run.phase,
        "synthetic": int(run.origin == "simulated"),
        "status": run.status,
        "stage": run.stage,
        "language": run.language,
        "version": run.version.number,
        "definition_sha256": run.version.definition_sha256,
        "seed": run.seed,
        "slot": run.slot if run.slot != NO_SLOT else "",
        "group_name": run.group_name,
        "started_at": _time(run.started_at),
        "consented_at": _time(run.consented_at),
        "completed_at": _time(run.completed_at),
        "trials": run.trials_total,
        "excluded": int(run.excluded),
        "exclusion_reason": run.exclusion_reason or "",
        "erased": int(run.erased_at is not None),
        **{one.column.name: one.value(answers) for one in forms},
        "device": _json(run.device),
        "run_origin": run.origin,
        "data_series": run.version.series,
        **_calibration(session, run),
    } | _evidence(session, run)


def _calibration(session: Session, run: StudyRun) -> dict[str, Any]:
    """How the latest size and distance were measured; nothing where none were, or by a page of before."""
    every = calibrations(session, run)
    rechecks = [one.recheck_percent for one in every if one.recheck_percent is not None]
    latest = every[-1] if every else None
    values = {
        "calibration_method": latest and latest.method,
        "calibration_repeats": latest and latest.repeats,
        "calibration_spread": latest and latest.spread_percent,
        "calibration_ruler": latest and latest.ruler_check,
        "calibration_recheck": max(rechecks, default=None),
        "distance_method": latest and latest.distance_method,
        "distance_spread_mm": latest and latest.distance_spread_mm,
        "distance_typed_mm": latest and latest.distance_typed_mm,
    }
    return {name: "" if value is None else value for name, value in values.items()}


def _evidence(session: Session, run: StudyRun) -> dict[str, Any]:
    judged = judge_run(session, run)
    values = {f"evidence_{name}": _rounded(value) for name, value in asdict(judged.signals).items()}
    points = "" if judged.verdict == "not_judged" else judged.points
    return values | {"evidence_verdict": judged.verdict, "evidence_points": points}


def _rounded(value: float | None) -> float | str:
    return "" if value is None else round(value, 4)


def _time(moment: datetime | None) -> str:
    return iso(moment) if moment else ""


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)


def raw_lines(session: Session, study: Study, extract: Extract) -> Iterator[str]:
    """One JSON object a run with every play, drawn frame, event, form and calibration."""
    for public_id in repository.public_ids(session, study, extract):
        yield service.timeline(session, study, public_id).model_dump_json() + "\n"
