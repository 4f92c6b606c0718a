"""The analysis of continuous ratings: mean traces, and how ratings follow the blinks of the clips."""

import json
from collections.abc import Sequence

import numpy as np
import pandas as pd

from analysis.plans.plan import Plan, PlanRows, where
from analysis.read.reading import Reading
from analysis.report.contents import Contents
from analysis.traces import ClipTraces, MeanTrace, lag_of, mean_trace
from experiments import design
from experiments.declaration.continuous_rating import ContinuousRating, continuous_rating_of
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds.continuous_rating import TRACES

READING = Reading(
    TRACES,
    texts=("cell", "clip_sha256", "trace", "blinks_s"),
    numbers=("response", "step_frames", "clip_fps"),
)


def check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    """Reject a trace that is not a list of numbers within the declared range."""
    trial = continuous_rating_of(experiment)
    for position, text in enumerate(rows["trace"].astype(str)):
        # A trial without an answer has no trace.
        if text in ("", "nan") or _is_trace(text, trial):
            continue
        raise InputError(
            f"{source}: {where(rows, position)}: expected a trace of numbers from {trial.minimum:g} to "
            f"{trial.maximum:g} as a JSON list, got {text[:40]}"
        )


def _is_trace(text: str, trial: ContinuousRating) -> bool:
    try:
        values = np.asarray(json.loads(text), dtype=float)
    except (ValueError, TypeError):
        return False
    return (
        values.ndim == 1
        and values.size > 0
        # NaN is in no range, so it is refused as well.
        and bool(((values >= trial.minimum) & (values <= trial.maximum)).all())
    )


def analyse(prepared: PlanRows) -> Contents:
    """Mean traces of the cells, and the lag behind blinks."""
    from analysis.report.trace_contents import contents_of

    clips = clips_of(prepared)
    lag = lag_of(clips, continuous_rating_of(prepared.experiment).max_lag_s)
    return contents_of(prepared, cell_traces(prepared.experiment, clips), lag, len(clips))


def clips_of(prepared: PlanRows) -> list[ClipTraces]:
    """The traces of each clip of each cell; a person has as many as times they rated it.

    Clips without blinks are one file whatever their exemplar, so one file may be several trials.
    """
    clips = []
    rows = prepared.rows
    rates = rows["clip_fps"].to_numpy(dtype=float) / rows["step_frames"].to_numpy(dtype=float)
    # Rounded, since equal rates may differ in their last bits.
    if len(np.unique(np.round(rates[np.isfinite(rates)], 6))) > 1:
        raise InputError(
            f"{prepared.source}: expected traces with one sampling rate, got several; analyze clips of one "
            "frame rate at a time"
        )
    # By file as well: traces are aligned with the blinks of one clip.
    for (cell, clip), mine in rows.assign(rate_hz=rates).groupby(["cell", "clip_sha256"], observed=True):
        given = mine[~mine["trace"].astype(str).isin(("", "nan"))]
        traces = [json.loads(str(text)) for text in given["trace"]]
        if not traces:
            continue
        # The shortest trace of a clip decides: a mean needs a value of everybody.
        samples = min(map(len, traces))
        blinks = str(mine["blinks_s"].iloc[0])
        # A clip without known blinks has no list here.
        events = tuple(json.loads(blinks)) if blinks.startswith("[") else ()
        values = np.array([trace[:samples] for trace in traces], dtype=float)
        people = tuple(given["participant"].astype(str))
        clips.append(ClipTraces(str(clip), str(cell), float(mine["rate_hz"].iloc[0]), events, people, values))
    if not clips:
        raise InputError(f"{prepared.source}: no trial has a trace; nothing to analyze")
    return clips


def cell_traces(experiment: Experiment, clips: Sequence[ClipTraces]) -> tuple[MeanTrace, ...]:
    """The mean trace of every cell that has one, in declared order."""
    order = ["/".join(level for _, level in cell) for cell in design.cells(experiment)]
    groups = [[clip for clip in clips if clip.cell == name] for name in order]
    return tuple(mean_trace(group) for group in groups if group)


PLAN = Plan(READING, check, analyse)
