"""A study with very many ratings, put straight into the database: for measurements of what reads them."""

import uuid
from datetime import timedelta
from typing import Any

from sqlalchemy import Insert, func, insert, literal_column, select
from sqlalchemy.orm import DeclarativeBase

from server.context import Services
from server.core.values import now
from server.models import (
    AssignedTrial,
    Link,
    Rating,
    RunTally,
    Study,
    StudyRun,
    StudyVersion,
    TrialClip,
    VersionClip,
)
from server.participation.tally_pools import Recount
from tests.helpers.studies import StudyInDatabase


def add_runs(services: Services, study: StudyInDatabase, runs: int, trials: int) -> None:
    """Complete runs with `trials` rated trials each: one in twenty flagged, every drawn frame logged.

    One run is made, the database copies its trials for the others: a million take seconds.
    """
    with services.database.read() as session:
        wanted = select(StudyVersion).join(Study, Study.id == StudyVersion.study_id)
        version = session.scalars(wanted.where(Study.name == study.name)).one()
        clips = list(session.execute(select(VersionClip.id, VersionClip.clip_sha256)))
        link = session.scalars(select(Link.id)).first()
        first = (session.scalar(select(func.max(StudyRun.id))) or 0) + 1
    place = {"study_id": version.study_id, "version_id": version.id, "link_id": link}
    with services.database.write() as session:
        session.execute(insert(StudyRun), [_run(first + more, trials) | place for more in range(runs)])
        session.execute(insert(AssignedTrial), [_assigned(first, trial) for trial in range(trials)])
        session.execute(insert(TrialClip), [_clip(first, trial, clips) for trial in range(trials)])
        session.execute(insert(Rating), [_rating(first, trial, clips) for trial in range(trials)])
        counted = Recount(services.versions).counted(session, [first])[first]
        session.execute(insert(RunTally).values(study_run_id=first, **counted.values()))
        session.execute(_copied(RunTally, first))
        session.execute(_copied(AssignedTrial, first))
        session.execute(_copied(TrialClip, first))
        session.execute(_copied(Rating, first))


def _copied(table: type[DeclarativeBase], template: int) -> Insert:
    """The template run's rows once for every run after it."""
    names = [column.name for column in table.__table__.columns if column.name not in ("id", "study_run_id")]
    columns = [literal_column(f"{table.__tablename__}.{name}") for name in names]
    rows = select(StudyRun.id, *columns).select_from(StudyRun).join(table, table.study_run_id == template)  # type: ignore[attr-defined]
    return insert(table).from_select(["study_run_id", *names], rows.where(StudyRun.id > template))


def _run(number: int, trials: int) -> dict[str, Any]:
    moment = now()
    return {
        "id": number,
        "public_id": f"run{number:08d}",
        "client_id": str(number),
        "token_hash": f"{number:064d}",
        "participant": f"p{number}",
        "phase": "live",
        "origin": "simulated",
        "status": "complete",
        "stage": "done",
        "language": "en",
        "seed": number,
        "slot": number,
        "trials_total": trials,
        "trials_answered": trials,
        "started_at": moment - timedelta(minutes=30),
        "last_seen_at": moment,
        "completed_at": moment,
    }


def _assigned(run: int, trial: int) -> dict[str, Any]:
    return {
        "study_run_id": run,
        "trial_index": trial,
        "kind": "main",
        "block": 1,
        "block_label": "all",
        "expected_response": None,
    }


def _clip(run: int, trial: int, clips: list[Any]) -> dict[str, Any]:
    clip = clips[trial % len(clips)].id
    return {
        "study_run_id": run,
        "trial_index": trial,
        "role": "shown",
        "position": 0,
        "version_clip_id": clip,
    }


def _rating(run: int, trial: int, clips: list[Any]) -> dict[str, Any]:
    flagged = trial % 20 == 0
    return {
        "rating_id": str(uuid.UUID(int=trial)),
        "study_run_id": run,
        "trial_index": trial,
        "play": 1,
        "kind": "clip_rating",
        "payload": {"response": 1 + trial % 7},
        "rt": 640.5 + trial,
        "rt_from_first_frame": 2100.25 + trial,
        "time_elapsed": 6000.0 * (trial + 1),
        "method": "webcodecs",
        "clip_sha256": clips[trial % len(clips)].clip_sha256,
        "key_to_first_frame_ms": 9.5,
        "frames_drawn": 45,
        "frames_late": int(flagged),
        "frames_missing": int(flagged),
        "longest_gap_ms": 34.1,
        "stalls": 0,
        "focus_lost": False,
        "refresh_rate_hz": 60.0,
        "device_pixel_ratio": 2.0,
        "px_per_mm": 3.78,
        "verdict": "flagged" if flagged else "good",
        "verdict_rule": "flagged_missing_frames" if flagged else "",
        "drawn": [[frame, round(10 + 33.3 * frame, 1)] for frame in range(45)],
        "saved_at": now(),
    }
