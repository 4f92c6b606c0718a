"""From cell sums to single ratings in the order of a visit: rows as the server exports them."""

import csv
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.published import DesignSpace
from analysis.synthetic.synthesise import Synthetic
from analysis.synthetic.targets import Steps
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import BlockSpec, ClipSpec, RatedScale
from experiments.design import blocks, exemplar_key, rated_clips
from experiments.files import whole_file
from experiments.kinds.clip_rating import RATINGS
from experiments.schema.canonical import definition_sha256
from table_files.formulas import guarded_row

Integers = NDArray[np.int64]
Row = dict[str, Any]

WIDTH = 6
"""Width of the scales of Exp 1 to 3, from 1 to 7; the two spreads below are of their ratings."""

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
    # The spread is one of a scale from 1 to 7; others are wider or narrower.
    sd = TRIAL_SD * (high - low) / WIDTH
    ratings = np.clip(np.rint(means + rng.normal(size=len(means)) * sd), low, high).astype(np.int64)
    # Repeated, since near an end of the scale fewer ratings can move than points are missing.
    while (gap := total - int(ratings.sum())) != 0:
        movable = np.flatnonzero(ratings < high if gap > 0 else ratings > low)
        # At random, or the first ratings of a cell would be systematically different.
        chosen = rng.permutation(movable)[: abs(gap)]
        ratings[chosen] += 1 if gap > 0 else -1
    return ratings


class Totals(NamedTuple):
    """Sums of the ratings of every cell on a scale, in its steps: (participants, cells) or (cells,)."""

    scale: RatedScale
    sums: Integers


def rating_rows(
    experiment: Experiment, space: DesignSpace, totals: Sequence[Totals], rng: np.random.Generator
) -> Iterator[Row]:
    """Yield one mapping per trial and scale with the columns of the CSV export, every one marked synthetic.

    Parameters
    ----------
    totals : sequence of Totals
        Of every scale in order, cells in the order of `space`.
    """
    # As sets: specs may name factors in another order than the space.
    cells = {
        frozenset(zip(space.factors, names, strict=True)): i for i, names in enumerate(product(*space.levels))
    }
    by_cell: list[list[ClipSpec]] = [[] for _ in cells]
    rated = rated_clips(experiment)
    for spec in rated:
        by_cell[cells[frozenset(spec.levels)]].append(spec)
    # Sorted, so that the same seed gives each key the same number.
    keys = sorted({exemplar_key(experiment, spec) for spec in rated})
    # Drawn once for all people, since clips differ for everybody.
    own = [{key: rng.normal() * BLINK_SD for key in keys} for _ in totals]
    common = _common(experiment)
    for person in range(len(totals[0].sums)):
        answers = [
            _answers(experiment, by_cell, Totals(scale, rows[person]), offsets, rng)
            for (scale, rows), offsets in zip(totals, own, strict=True)
        ]
        yield from _visit(experiment, f"S{person + 1:03d}", answers, common, rng)


class OnScale(NamedTuple):
    """A participant's ratings of every clip on one scale, those of repeats in any order."""

    scale: RatedScale
    ratings: dict[ClipSpec, list[float]]


def _answers(
    experiment: Experiment,
    by_cell: list[list[ClipSpec]],
    totals: Totals,
    own: dict[str, float],
    rng: np.random.Generator,
) -> OnScale:
    steps = Steps.of(totals.scale)
    ratings: dict[ClipSpec, list[float]] = {}
    for specs, total in zip(by_cell, totals.sums, strict=True):
        for spec, drawn in _cell_answers(experiment, specs, int(total), steps, own, rng).items():
            ratings[spec] = [steps.rating(k) for k in drawn]
    return OnScale(totals.scale, ratings)


def _cell_answers(
    experiment: Experiment,
    specs: list[ClipSpec],
    total: int,
    steps: Steps,
    own: dict[str, float],
    rng: np.random.Generator,
) -> dict[ClipSpec, list[int]]:
    repeats, unit = experiment.blocks.repeats, (steps.high - steps.low) / WIDTH
    # A clip that is repeated has one offset in all its repeats.
    offsets = unit * np.repeat([own[exemplar_key(experiment, spec)] for spec in specs], repeats)
    # Centered, so that the cell's mean stays what its total says.
    means = total / len(offsets) + offsets - offsets.mean()
    drawn = split_sum(total, means, steps.low, steps.high, rng)
    return {spec: drawn[i * repeats : (i + 1) * repeats].tolist() for i, spec in enumerate(specs)}


def _common(experiment: Experiment) -> Row:
    return {
        # The name marks the data, in addition to the column `synthetic`.
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
        "not_applicable": 0,
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
    # Repeats are whole cycles of the same blocks.
    kinds = len(declared) // experiment.blocks.repeats
    start = int(rng.integers(kinds))
    return [declared[(start + i) % kinds] for i in range(len(declared))]


def _visit(
    experiment: Experiment,
    participant: str,
    answers: list[OnScale],
    common: Row,
    rng: np.random.Generator,
) -> Iterator[Row]:
    index, clock = 0, 0.0
    empty = dict.fromkeys(name for name in RATINGS.names if name != "levels")
    for number, block in enumerate(_block_order(experiment, rng), start=1):
        rated = [spec for spec in block.clips if experiment.trial.rates(experiment, spec)]
        order = rng.permutation(len(rated))
        # Lognormal: response times are never negative and have a long tail.
        times = np.round(MEDIAN_RT_MS * np.exp(0.35 * rng.normal(size=len(order))), 1)
        for position, rt in zip(order, times.tolist(), strict=True):
            spec = rated[position]
            times_of = _scale_times(rt, len(answers), rng)
            clock += CLIP_MS + times_of[-1]
            trial = {
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
                # The last answer ends the trial; `scale_rt` has the others.
                "rt": times_of[-1],
                "rt_from_first_frame": round(CLIP_MS + times_of[-1], 1),
                "time_elapsed": round(clock, 1),
            }
            for (scale, ratings), scale_rt in zip(answers, times_of, strict=True):
                yield {
                    **trial,
                    "scale": scale.name,
                    # Taken from the end: ratings of repeats are in no order.
                    "response": ratings[spec].pop(),
                    "scale_rt": scale_rt if len(answers) > 1 else None,
                }
            index += 1


def _scale_times(first_ms: float, scales: int, rng: np.random.Generator) -> list[float]:
    """Times in ms from the clip's end to the answer on each scale, one after the other."""
    further = MEDIAN_RT_MS * np.exp(0.35 * rng.normal(size=scales - 1))
    return [round(float(time), 1) for time in np.cumsum([first_ms, *further])]


# Ratings of synthetic participants as the server's CSV export.


def write_ratings(scales: Sequence[Synthetic], out: Path) -> int:
    """Write the ratings as the server's CSV export, every row marked synthetic.

    Parameters
    ----------
    scales : sequence of Synthetic
        The same participants on every scale of the study, in order.
    out : Path
        The CSV file.

    Returns
    -------
    int
        Rows: one per trial and scale.
    """
    first = scales[0]
    header = RATINGS.csv_header(first.experiment.factor_names)
    # [seed, 1]: another stream than that of the sums, which uses the seed alone.
    rng = np.random.default_rng([first.seed, 1])
    sums = [Totals(made.scale, made.sums) for made in scales]
    count = 0
    with whole_file(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.writer(handle, lineterminator="\n")
        # Guarded: a cell that begins like a formula would be run by a spreadsheet.
        writer.writerow(guarded_row(header))
        for row in rating_rows(first.experiment, first.space, sums, rng):
            writer.writerow(guarded_row(row[name] for name in header))
            count += 1
    return count
