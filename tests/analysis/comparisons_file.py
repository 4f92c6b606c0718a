"""Exports of simulated comparisons, as the server writes them, for tests of the analysis."""

import csv
import math
import random
from collections.abc import Mapping
from pathlib import Path

from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from experiments.kinds.paired_comparison import COMPARISONS

Row = dict[str, object]


def compare(
    experiment: Experiment, abilities: Mapping[str, float], participants: int, nu: float = 0.0, seed: int = 1
) -> list[Row]:
    """One export row per comparison, answered by Davidson's model (Bradley-Terry where `nu` is 0)."""
    rng, rows = random.Random(seed), []
    for person in range(participants):
        trials = KINDS[experiment.trial.kind].assign(experiment, person, person)
        for index, trial in enumerate(trials):
            if trial.kind != "main":
                continue
            left, right = (shown.clip for shown in trial.shown[:2])
            odds = [math.exp(abilities[clip.cell]) for clip in (left, right)]
            winner = rng.choices(["left", "right", "tie"], [*odds, nu * math.sqrt(odds[0] * odds[1])])[0]
            rows.append(
                row_of(experiment, person, index)
                | {"left_cell": left.cell, "right_cell": right.cell, "winner": winner}
            )
    return rows


def row_of(experiment: Experiment, person: int, index: int) -> Row:
    """A row without its pair and answer."""
    row: Row = dict.fromkeys(COMPARISONS.names, "")
    row |= {"study": "s", "experiment": experiment.name, "phase": "live", "synthetic": 1, "kind": "main"}
    row |= {"run": f"r{person}", "participant": f"P{person:02d}", "run_status": "complete", "play": 1}
    row |= {"trial_index": index, "rt": 900, "verdict": "good", "excluded": 0, "run_origin": "simulated"}
    return row | {"study_version": 1, "data_series": 1, "arrangement": "side_by_side"}


def write_comparisons(path: Path, rows: list[Row]) -> Path:
    """Write rows as the CSV export has them."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COMPARISONS.names)
        writer.writeheader()
        writer.writerows(rows)
    return path
