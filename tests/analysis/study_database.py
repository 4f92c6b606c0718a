"""A study's database, made by the real migrations and filled in bulk, for tests and benchmarks."""

import json
import sqlite3
from itertools import product
from pathlib import Path

import numpy as np

from experiments.declaration.experiment import Experiment
from experiments.schema.canonical import definition_sha256
from server.core import migrate
from server.core.db import Database

NOW = "2026-11-21 10:00:00.000000"


def make_database(
    path: Path, experiment: Experiment, ratings: np.ndarray, *, participants: list[str], phase: str = "live"
) -> str:
    """Store whole ratings (N, a, b, ..., trials) of a synthetic study; give back the database's URL."""
    url = f"sqlite:///{path}"
    database = Database(url)
    migrate.upgrade(database)
    database.engine.dispose()
    connection = sqlite3.connect(path)
    _study(connection, experiment, ratings.shape[-1])
    flat = ratings.reshape(len(ratings), -1)
    _insert(
        connection,
        "study_runs",
        [_run(i, who, phase, flat.shape[1]) for i, who in enumerate(participants, 1)],
    )
    trials = (
        {"study_run_id": run, "trial_index": t, "kind": "main", "block": 1, "block_label": "all"}
        for run in range(1, len(participants) + 1)
        for t in range(flat.shape[1])
    )
    _insert(connection, "assigned_trials", trials)
    clips = (
        {"study_run_id": run, "trial_index": t, "role": "shown", "position": 0, "version_clip_id": t + 1}
        for run in range(1, len(participants) + 1)
        for t in range(flat.shape[1])
    )
    _insert(connection, "trial_clips", clips)
    _insert(connection, "trial_ratings", _ratings(flat))
    connection.commit()
    connection.close()
    return url


def _study(connection: sqlite3.Connection, experiment: Experiment, exemplars: int) -> None:
    study = {"id": 1, "name": f"{experiment.name}-test", "title": "T", "status": "live", "paused": 0}
    study |= {"active_version": 1, "revision": 1, "created_at": NOW}
    version = {"id": 1, "study_id": 1, "number": 1, "experiment": experiment.name, "definition_toml": ""}
    version |= {"definition": "{}", "definition_sha256": definition_sha256(experiment), "manifest": "{}"}
    _insert(connection, "studies", [study])
    _insert(connection, "study_versions", [version | {"note": "", "created_at": NOW}])
    names = experiment.analysis.factors or experiment.factor_names
    cells = list(product(*([level.name for level in experiment.factor(name).levels] for name in names)))
    clips = [
        {"id": i * exemplars + e + 1, "version_id": 1, "clip_sha256": f"{i}-{e}", "cell": "/".join(cell)}
        | {"levels": json.dumps(dict(zip(names, cell, strict=True))), "exemplar": e + 1}
        | {"profile_id": f"p{e}", "file": f"{i}-{e}.mp4"}
        for i, cell in enumerate(cells)
        for e in range(exemplars)
    ]
    _insert(connection, "version_clips", clips)


def _run(number: int, participant: str, phase: str, trials: int) -> dict:
    texts = {"public_id": f"run{number:06d}", "client_id": f"c{number}", "token_hash": f"t{number}"}
    state = {"phase": phase, "origin": "simulated", "status": "complete", "stage": "done"}
    numbers = {
        "study_id": 1,
        "version_id": 1,
        "link_id": 1,
        "seed": number,
        "slot": number,
        "elapsed_ms": 0.0,
    }
    counts = {"trials_total": trials, "trials_answered": trials, "excluded": 0}
    rest = {"language": "en", "started_at": NOW, "last_seen_at": NOW, "completion_code": ""}
    documents = {"device": "{}"}
    return {"id": number, "participant": participant} | texts | state | numbers | counts | rest | documents


def _ratings(flat: np.ndarray):
    for run, answers in enumerate(flat.tolist(), 1):
        for trial, response in enumerate(answers):
            yield {
                "rating_id": f"{run}-{trial}",
                "study_run_id": run,
                "trial_index": trial,
                "play": 1,
                "kind": "clip_rating",
                "payload": f'{{"response": {json.dumps(response)}}}',
                "rt": 900.0,
                "changes": 0,
                "method": "webcodecs",
                "verdict": "good",
                "verdict_rule": "",
                "saved_at": NOW,
            }


def _insert(connection: sqlite3.Connection, table: str, rows) -> None:
    rows = iter(rows)
    first = next(rows)
    names = ", ".join(first)
    marks = ", ".join("?" * len(first))
    connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(first.values()))
    connection.executemany(
        f"INSERT INTO {table} ({names}) VALUES ({marks})", (tuple(row.values()) for row in rows)
    )
