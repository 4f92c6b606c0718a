"""What `stimuli blinks` does: read, label, apply the review, write everything or nothing."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.errors import InputError
from experiments.files import check_ending, check_targets
from stimuli_builder.blinks.both_eyes import all_profiles, asymmetry_lines, both_eyes
from stimuli_builder.blinks.column_names import eye_of
from stimuli_builder.blinks.console_report import print_blinks, print_written
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.extract import EyeBlinks, blinks_of, rate_doubts, why_no_blink
from stimuli_builder.blinks.file_endings import TABLE
from stimuli_builder.blinks.label_options import LabelOptions
from stimuli_builder.blinks.outputs import MoreOutputs
from stimuli_builder.blinks.profile import BlinkProfile
from stimuli_builder.blinks.profile_table import write_profile_table
from stimuli_builder.blinks.review import (
    Review,
    decide,
    match_frames,
    merge,
    moved_edges,
    parse_choice,
    read_reviews,
    write_reviews,
)
from stimuli_builder.blinks.series import BlinkSeries, read_series
from stimuli_builder.blinks.tables import blinks_frame, summarise, write_blinks, write_events, write_summary
from stimuli_builder.blinks.units import iris_table


@dataclass(frozen=True)
class BlinksJob:
    """One call of `stimuli blinks`; the fields are its options."""

    series: Path
    out: Path
    columns: tuple[str, ...]
    fps: float | None
    profiles: Path
    options: LabelOptions
    closed: float | None = None
    complete_from: float = 0.95
    allow_gaps: bool | None = None
    classify: bool = True
    events: Path | None = None
    resample: bool = False
    inverted: bool | None = None
    more: MoreOutputs = field(default_factory=MoreOutputs)
    summary: Path | None = None
    plot: Path | None = None
    plot_aligned: Path | None = None
    review: Path | None = None
    reject: tuple[str, ...] = ()
    accept: tuple[str, ...] = ()


def run_blinks(job: BlinksJob) -> None:
    """Label the series of a job; all checks come before the first file is written."""
    _check(job)
    eyes = label_recording(job)
    reviews, decided, lost = _reviewed(job, eyes)
    eyes = [_with_moved_edges(job, eye, decided) for eye in eyes]
    frame = blinks_frame([blink for eye in eyes for blink in eye.blinks], decided, both_eyes(eyes))
    accepted = [_accepted_only(eye, decided) for eye in eyes]
    names = [eye_of(eye.series.column) for eye in eyes]
    profiles = all_profiles(accepted, job.series.stem, names)
    if not profiles and len(frame):
        raise InputError("the review rejects every blink: nothing is left to write")
    for line in asymmetry_lines(eyes, _rejected(decided)):
        sys.stderr.write(f"note: {line}\n")
    summaries = [
        summarise(eye, frame, [p for p in profiles if p.eye == name and _is_of(p, eye)])
        for eye, name in zip(accepted, names, strict=True)
    ]
    written = _write(job, _Labelled(eyes, frame, profiles, summaries, decided, reviews))
    print_blinks(summaries, lost, closed_given=job.closed is not None)
    print_written(len(frame), written)


@dataclass(frozen=True, eq=False)
class _Labelled:
    """A labelled and reviewed recording, as it is written; `decided` and `reviews` as of `_reviewed`."""

    eyes: Sequence[EyeBlinks]
    frame: pd.DataFrame
    profiles: Sequence[BlinkProfile]
    summaries: Sequence[dict[str, Any]]
    decided: Mapping[tuple[str, int], Review]
    reviews: Sequence[Review]


def _write(job: BlinksJob, labelled: _Labelled) -> list[Path | None]:
    """Write what the job asks for; without a blink the table of profiles is empty. Return the files."""
    more = job.more.prepared(job.series, labelled.eyes, labelled.frame, job.closed)
    _write_figures(job, labelled.eyes, labelled.decided, labelled.profiles)
    write_profile_table(job.profiles, labelled.profiles)
    if job.summary is not None:
        write_summary(job.summary, labelled.summaries)
    if job.review is not None and (job.reject or job.accept):
        write_reviews(job.review, labelled.reviews)
    for write in more:
        write()
    events = job.events if job.classify else None
    if events is not None:
        write_events(events, labelled.eyes)
    write_blinks(job.out, labelled.frame)
    aligned = job.plot_aligned if labelled.profiles else None
    return [job.out, job.profiles, events, *job.more.paths, job.summary, job.plot, aligned]


def label_recording(job: BlinksJob) -> list[EyeBlinks]:
    """Label every column of the job; an unlikely rate is told.

    A recording without a blink is a result too: a warning says why, and the tables are empty.
    """
    given = read_series(
        job.series,
        job.columns,
        job.fps,
        allow_gaps=job.allow_gaps,
        resample=job.resample,
        inverted=job.inverted,
    )
    for note in given[0].notes:
        sys.stderr.write(f"note: {note}\n")
    eyes = _blinks_of_all(job, given)
    if not any(eye.blinks for eye in eyes):
        sys.stderr.write(f"warning: {why_no_blink(eyes[0], job.options)}\n")
    for doubt in rate_doubts(eyes):
        sys.stderr.write(f"warning: {doubt}\n")
    return eyes


def _blinks_of_all(job: BlinksJob, given: Sequence[BlinkSeries]) -> list[EyeBlinks]:
    seen = recognise(given) if job.classify else [None] * len(given)
    return [
        blinks_of(
            series,
            job.options,
            closed_distance=job.closed,
            complete_from=job.complete_from,
            recognised=recognised,
        )
        for series, recognised in zip(given, seen, strict=True)
    ]


def _check(job: BlinksJob) -> None:
    """Refuse what can be seen to be wrong before anything is read."""
    from stimuli_builder.blinks.plots import check_figure_name

    if not 0 < job.complete_from <= 1:
        raise InputError(f"--complete-from is a closure above 0 and up to 1, got {job.complete_from:g}")
    if job.closed is not None and job.closed < 0:
        raise InputError(f"--closed is a distance, 0 or more, got {job.closed:g}")
    if (job.reject or job.accept) and job.review is None:
        raise InputError("--reject and --accept are kept in a review file: name it with --review FILE")
    for figure in (job.plot, job.plot_aligned):
        if figure is not None:
            check_figure_name(figure)
    job.more.check()
    _check_files(job)


def _check_files(job: BlinksJob) -> None:
    """Refuse names of files that cannot be written, or that tell of another kind of file."""
    events = job.events if job.classify else None
    tables = {"--out": job.out, "--profiles": job.profiles, "--events": events, "--review": job.review}
    figures = (job.plot, job.plot_aligned)
    outputs = [*tables.values(), *job.more.paths, job.summary, *figures]
    check_targets(outputs, [job.series, iris_table(job.more.scale)])
    for option, path in tables.items():
        check_ending(path, TABLE, option)
    check_ending(job.summary, (".json",), "--summary")
    job.more.check_names()


def _reviewed(
    job: BlinksJob, eyes: Sequence[EyeBlinks]
) -> tuple[list[Review], dict[tuple[str, int], Review], list[Review]]:
    blinks = [blink for eye in eyes for blink in eye.blinks]
    reach = match_frames(eyes[0].series.fps)
    new = [parse_choice(text, "reject", blinks) for text in job.reject]
    new += [parse_choice(text, "accept", blinks) for text in job.accept]
    old = read_reviews(job.review) if job.review is not None else []
    if job.review is not None and not new and not job.review.exists():
        raise InputError(f"{job.review}: there is no such review file; --reject N=reason begins one")
    reviews = merge(old, new, reach)
    return reviews, *decide(blinks, reviews, reach)


def _with_moved_edges(job: BlinksJob, eye: EyeBlinks, decided: Mapping[tuple[str, int], Review]) -> EyeBlinks:
    edges = moved_edges(eye.blinks, decided, eye.series.column)
    if not edges:
        return eye
    return blinks_of(
        eye.series,
        job.options,
        closed_distance=job.closed,
        complete_from=job.complete_from,
        edges=edges,
        recognised=eye.recognised,
    )


def _rejected(decided: Mapping[tuple[str, int], Review]) -> set[tuple[str, int]]:
    return {key for key, review in decided.items() if review.decision == "reject"}


def _accepted_only(eye: EyeBlinks, decided: Mapping[tuple[str, int], Review]) -> EyeBlinks:
    rejected = _rejected(decided)
    kept = tuple(blink for blink in eye.blinks if (blink.column, blink.number) not in rejected)
    return replace(eye, blinks=kept)


def _is_of(profile: BlinkProfile, eye: EyeBlinks) -> bool:
    return profile.closure_other is None and f", {eye.series.column}, " in profile.source


def _write_figures(
    job: BlinksJob,
    eyes: Sequence[EyeBlinks],
    decided: Mapping[tuple[str, int], Review],
    profiles: Sequence[BlinkProfile],
) -> None:
    if job.plot is None and job.plot_aligned is None:
        return
    from stimuli_builder.blinks.plots import aligned_figure, save_figure, series_figure

    if job.plot is not None:
        save_figure(series_figure(eyes, _rejected(decided)), job.plot)
    if job.plot_aligned is not None and not profiles:
        older = "; the one that is there is of an earlier call" if job.plot_aligned.exists() else ""
        why = f"there is no blink to lay on others{older}"
        sys.stderr.write(f"note: {job.plot_aligned} is not written: {why}\n")
    elif job.plot_aligned is not None:
        groups = {eye.series.column: [p for p in profiles if _is_of(p, eye)] for eye in eyes}
        save_figure(
            aligned_figure({name: group for name, group in groups.items() if group}), job.plot_aligned
        )
