"""From cell sums to single ratings in the order of a visit: rows as the server exports them."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.space import DesignSpace
from experiments.definition import Experiment
from experiments.design import BlockSpec, ClipSpec, blocks, clips, exemplar_key
from experiments.schema.canonical import definition_sha256
from experiments.trials.clip_rating.columns import RATINGS
from experiments.trials.scales import scale_called

Integers = NDArray[np.int64]
Row = dict[str, Any]

TRIAL_SD = 1.1
"""Spread of the ratings within a participant's cell before they are made to sum up."""

BLINK_SD = 0.2
"""Spread of the blinks' own means, so that clips differ as real ones do."""

MEDIAN_RT_MS = 1400.0
CLIP_MS = 2000.0


def split_sum(
    total: int, means: NDArray[np.float64], low: int, high: int, rng: np.random.Generator
) -> Integers:
    """Draw len(means) whole ratings in [low, high] around `means` that add up to `total`."""
    ratings = np.clip(np.rint(means + rng.normal(size=len(means)) * TRIAL_SD), low, high).astype(np.int64)
    while (gap := total - int(ratings.sum())) != 0:
        movable = np.flatnonzero(ratings < high if gap > 0 else ratings > low)
        chosen = rng.permutation(movable)[: abs(gap)]
        ratings[chosen] += 1 if gap > 0 else -1
    return ratings


def rating_rows(
    experiment: Experiment, space: DesignSpace, sums: Integers, rng: np.random.Generator
) -> Iterator[Row]:
    """Yield one mapping a trial with the columns of the CSV export, every one marked synthetic.

    `sums` (participants, cells) are the cells' sums of ratings, cells in the order of `space`.
    """
    cells = {
        frozenset(zip(space.factors, names, strict=True)): i for i, names in enumerate(product(*space.levels))
    }
    by_cell: list[list[ClipSpec]] = [[] for _ in cells]
    for spec in clips(experiment):
        by_cell[cells[frozenset(spec.levels)]].append(spec)
    own = {
        key: rng.normal() * BLINK_SD
        for key in sorted({exemplar_key(experiment, s) for s in clips(experiment)})
    }
    common = _common(experiment)
    for person, row in enumerate(sums):
        answers: dict[ClipSpec, list[int]] = {}
        for specs, total in zip(by_cell, row, strict=True):
            answers |= _cell_answers(experiment, specs, int(total), own, rng)
        yield from _visit(experiment, f"S{person + 1:03d}", answers, common, rng)


def _cell_answers(
    experiment: Experiment, specs: list[ClipSpec], total: int, own: dict[str, float], rng: np.random.Generator
) -> dict[ClipSpec, list[int]]:
    repeats, scale = experiment.blocks.repeats, scale_called(experiment)
    offsets = np.repeat([own[exemplar_key(experiment, spec)] for spec in specs], repeats)
    means = total / len(offsets) + offsets - offsets.mean()
    drawn = split_sum(total, means, round(scale.minimum), round(scale.maximum), rng)
    return {spec: drawn[i * repeats : (i + 1) * repeats].tolist() for i, spec in enumerate(specs)}


def _common(experiment: Experiment) -> Row:
    return {
        "study": f"synthetic {experiment.name}",
        "experiment": experiment.name,
        "definition_sha256": definition_sha256(experiment),
        "phase": "live",
        "synthetic": 1,
        "run_status": "complete",
        "language": experiment.languages[0],
        "kind": "main",
        "play": 1,
        "changes": 0,
        "method": "none",
        "verdict": "good",
        "focus_lost": 0,
        "excluded": 0,
        "run_origin": "simulated",
        "study_version": 1,
        "data_series": 1,
    }


def _block_order(experiment: Experiment, rng: np.random.Generator) -> list[BlockSpec]:
    """Blocks as one visit sees them: shuffled, cycling from a random start, or as declared."""
    declared = blocks(experiment)
    if experiment.blocks.order == "fixed":
        return declared
    if experiment.blocks.order == "random":
        return [declared[i] for i in rng.permutation(len(declared))]
    kinds = len(declared) // experiment.blocks.repeats
    start = int(rng.integers(kinds))
    return [declared[(start + i) % kinds] for i in range(len(declared))]


def _visit(
    experiment: Experiment,
    participant: str,
    answers: dict[ClipSpec, list[int]],
    common: Row,
    rng: np.random.Generator,
) -> Iterator[Row]:
    index, clock = 0, 0.0
    empty = dict.fromkeys(name for name in RATINGS.names if name != "levels")
    for number, block in enumerate(_block_order(experiment, rng), start=1):
        order = rng.permutation(len(block.clips))
        times = np.round(MEDIAN_RT_MS * np.exp(0.35 * rng.normal(size=len(order))), 1)
        for position, rt in zip(order, times.tolist(), strict=True):
            spec = block.clips[position]
            clock += CLIP_MS + rt
            yield {
                **empty,
                **common,
                **dict(spec.levels),
                "run": f"synthetic-{participant}",
                "participant": participant,
                "trial_index": index,
                "block": number,
                "block_label": block.label,
                "cell": spec.cell,
                "exemplar": spec.exemplar,
                "profile_id": exemplar_key(experiment, spec),
                "stimulus": f"synthetic_{spec.cell.replace('/', '_')}_{spec.exemplar:03d}",
                "response": answers[spec].pop(),
                "rt": rt,
                "rt_from_first_frame": round(CLIP_MS + rt, 1),
                "time_elapsed": round(clock, 1),
            }
            index += 1
