"""Ratings exports of simulated participants, as the server writes them, for tests of the analysis."""

import csv
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np

from experiments.declaration.experiment import Experiment
from experiments.kinds.clip_rating import RATINGS

Row = dict[str, object]


def simulate(experiment: Experiment, participants: int, trials: int = 4, seed: int = 1) -> np.ndarray:
    """Whole ratings 1-7 (N, a, b, ..., trials) with differences between people, cells and trials."""
    random = np.random.default_rng(seed)
    names = experiment.analysis.factors or experiment.factor_names
    shape = [len(experiment.factor(name).levels) for name in names]
    cell = random.normal(0, 0.4, shape)[None, ..., None]
    person = random.normal(0, 0.8, (participants, *[1] * len(shape), 1))
    noise = random.normal(0, 0.4, (participants, *shape, 1)) + random.normal(
        0, 1, (participants, *shape, trials)
    )
    return np.clip(np.rint(4.2 + cell + person + noise), 1, 7).astype(int)


def rows_of(experiment: Experiment, ratings: np.ndarray) -> list[Row]:
    """One export row per rating."""
    names = experiment.analysis.factors or experiment.factor_names
    cells = list(product(*([level.name for level in experiment.factor(name).levels] for name in names)))
    rows = []
    for who, answers in enumerate(ratings.reshape(len(ratings), len(cells), -1)):
        for trial, (cell, exemplar) in enumerate(product(range(len(cells)), range(answers.shape[1]))):
            row: Row = dict.fromkeys([*RATINGS.names, *names], "")
            row |= {"study": "s", "experiment": experiment.name, "phase": "live", "synthetic": 1}
            row |= {"run_origin": "simulated", "study_version": 1, "data_series": 1}
            row |= {
                "run": f"run{who}",
                "participant": f"P{who:02d}",
                "run_status": "complete",
                "kind": "main",
            }
            row |= {
                "trial_index": trial,
                "play": 1,
                "exemplar": exemplar + 1,
                "stimulus": f"{cell}-{exemplar}.mp4",
            }
            row |= {
                "response": int(answers[cell, exemplar]),
                "rt": 900 + trial,
                "verdict": "good",
                "excluded": 0,
            }
            rows.append(row | dict(zip(names, cells[cell], strict=True)))
    return rows


def write_export(path: Path, experiment: Experiment, rows: list[Row]) -> Path:
    """Write rows as the CSV export has them."""
    header = RATINGS.csv_header(experiment.factor_names)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, header, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    return path


def change(rows: list[Row], where: Callable[[Row], bool], **values: object) -> list[Row]:
    """The rows with `values` set in those that `where` picks."""
    return [row | values if where(row) else row for row in rows]
