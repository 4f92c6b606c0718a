"""What `stimuli blinks` does: read, label, apply the review, write everything or nothing."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.errors import InputError
from experiments.files import check_ending, check_targets, whole_text
from stimuli_builder.blinks.both_eyes import all_profiles, asymmetry_lines, both_eyes
from stimuli_builder.blinks.columns import eye_of
from stimuli_builder.blinks.csv_table import read_table
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.export import AnimationCurve, CurveTarget, check_format, write_curve
from stimuli_builder.blinks.extract import (
    EyeBlinks,
    blinks_of,
    rate_doubts,
    speed_doubt,
    why_no_blink,
    without_blinks,
)
from stimuli_builder.blinks.labelling import LabelOptions
from stimuli_builder.blinks.profile import Array, BlinkProfile, write_profile_table
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
from stimuli_builder.blinks.tables import (
    blinks_frame,
    print_blinks,
    print_written,
    summarise,
    write_blinks,
    write_events,
    write_summary,
)
from stimuli_builder.blinks.units import (
    Scale,
    check_scale,
    closure_course,
    iris_table,
    scale_doubt,
    scale_of,
    write_lids,
)

# Endings of the files that `stimuli blinks` writes: what is in a file is what its name says.

TABLE = (".csv", ".txt")
CURVES = {
    "csv": TABLE,
    "arkit": TABLE,
    "json": (".json",),
    "blender": (".py",),
    "maya": (".anim",),
    "gltf": (".gltf",),
    "usd": (".usda", ".usd"),
}
"""Endings of `--curve` by `--curve-format`."""


def check_curve(path: Path | None, format_name: str) -> None:
    """Refuse a curve whose ending is not of its format; name the format that the ending is of."""
    if path is None:
        return
    endings, ending = CURVES[format_name], path.suffix.lower()
    # A table saved as .py is more likely a forgotten --curve-format than a wish.
    other = next((name for name, of_format in CURVES.items() if ending in of_format), None)
    if ending not in endings and other is not None:
        raise InputError(
            f"--curve {path.name}: --curve-format {format_name} is written as {' or '.join(endings)}; add "
            f"--curve-format {other}, or change the ending"
        )
    check_ending(path, endings, "--curve")


# The tracked recording itself as an animation curve: every frame's closure, looking down included.


def recorded_curve(eyes: Sequence[EyeBlinks], closed: float | None = None) -> AnimationCurve:
    """Closure of both lids over a whole recording at its own rate, gaps filled by straight lines.

    With one column both eyes move alike; of two, one without a blink stays open where `closed` is not given.
    The lower lids' motion is the track's where it is known, else 0.

    Parameters
    ----------
    closed : float, optional
        Distance at lid contact of eyes without a blink.

    Raises
    ------
    InputError
        There are more than two columns, or the closed level is unknown: no blink, and no `closed`.
    """
    if len(eyes) > 2:
        raise InputError(f"a curve has two eyes; select two with --column, got {len(eyes)} columns")
    if closed is None and not any(eye.blinks for eye in eyes):
        columns = ", ".join(f"'{eye.series.column}'" for eye in eyes)
        raise InputError(f"no blink in {columns}, so its closed level is unknown: add --closed")
    left, right = eyes[0], eyes[-1]
    # Columns may come in any order; a curve has left and right.
    if len(eyes) == 2 and eye_of(left.series.column) == "right":
        left, right = right, left
    blinks = [(f"blink {b.number}", b.onset_s * left.series.fps) for b in left.blinks or right.blinks]
    # A recording has one track of lower lids, the mean of both eyes.
    lower = left.series
    return AnimationCurve(
        fps=left.series.fps,
        left=_course(left, closed),
        right=_course(right, closed),
        lower_up_mm=_motion(lower.lower_up_mm, lower.distance.size),
        lower_nasal_mm=_motion(lower.lower_nasal_mm, lower.distance.size),
        blinks=tuple(blinks),
    )


def _course(eye: EyeBlinks, closed: float | None) -> Array:
    level = eye.closed_distance(closed)
    if level is None:
        return np.zeros(eye.series.distance.size)
    return _filled(closure_course(eye.series, level))


def _motion(place_mm: Array | None, count: int) -> Array:
    """Motion of the lower lid relative to its usual place; empty without a track."""
    if place_mm is None or not np.isfinite(place_mm).any():
        return np.zeros(count)
    # Relative to the median, since most frames are open: its usual place is where the lid rests.
    return _filled(place_mm - np.nanmedian(place_mm))


def _filled(values: Array) -> Array:
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(values.size), known, values[known])


# What else `stimuli blinks` writes of a recording: the report, every frame in units, an animation curve.


@dataclass(frozen=True)
class MoreOutputs:
    """Options of `stimuli blinks` for outputs in addition to the blinks table."""

    report: Path | None = None
    lids: Path | None = None
    scale: str | None = None
    curve: Path | None = None
    curve_format: str = "csv"

    @property
    def paths(self) -> tuple[Path | None, ...]:
        """Files to be written."""
        return self.report, self.lids, self.curve

    def check(self) -> None:
        """Refuse a format or a scale nobody knows before anything is read."""
        check_format(self.curve_format, CurveTarget(), "--curve-format")
        if self.scale is not None:
            check_scale(self.scale)
            if self.lids is None and self.report is None:
                sys.stderr.write("note: --scale has no effect here: it applies to --lids and --report\n")

    def check_names(self) -> None:
        """Reject names that indicate another kind of file."""
        check_curve(self.curve, self.curve_format)
        check_ending(self.report, (".html", ".htm"), "--report")
        check_ending(self.lids, TABLE, "--lids")

    def prepared(
        self, source: Path, eyes: Sequence[EyeBlinks], frame: pd.DataFrame, closed: float | None
    ) -> list[Callable[[], None]]:
        """Compute the requested outputs; the result writes them and can no longer be rejected.

        Parameters
        ----------
        closed : float or None
            Distance at lid contact that was given, for eyes without a blink too.

        Raises
        ------
        InputError
            The scale is unknown, or a column without a blink has no closed level.
        """
        if not any(self.paths):
            return []
        table = read_table(source)
        scale = self._scale(table, eyes, source)
        # A wrong scale spoils every figure in mm, so it is said on the terminal and in the report.
        doubts = [doubt for eye in eyes if (doubt := scale_doubt(eye.series, scale))]
        for doubt in doubts:
            sys.stderr.write(f"warning: {doubt}\n")
        writers: list[Callable[[], None]] = []
        if self.curve is not None:
            text = write_curve(self.curve_format, recorded_curve(eyes, closed), CurveTarget())
            writers.append(partial(_write_text, self.curve, text))
        if self.lids is not None:
            writers.append(partial(write_lids, self.lids, _with_closed(self.lids, eyes, closed), scale))
        if self.report is not None:
            from stimuli_builder.blinks.clinical_report import report_text

            page = report_text(source, eyes, frame, scale, [*_doubts(table, eyes), *doubts])
            writers.append(partial(_write_text, self.report, page))
        return writers

    def _scale(self, table: pd.DataFrame, eyes: Sequence[EyeBlinks], source: Path) -> Scale | None:
        scale, first = scale_of(table, self.scale, source), eyes[0].series
        if scale is not None and not first.is_px:
            raise InputError(
                f"--scale converts px to mm, but '{first.column}' is in another unit (names of columns in px "
                "end in _px): remove --scale, or use a track"
            )
        return scale


def _with_closed(
    path: Path, eyes: Sequence[EyeBlinks], closed: float | None
) -> list[tuple[BlinkSeries, float]]:
    """Each series with its closed distance; an eye whose distance is unknown is omitted with a note."""
    known = [(eye.series, eye.closed_distance(closed)) for eye in eyes]
    for series, level in known:
        if level is None:
            sys.stderr.write(
                f"note: {path}: {series.column} has no blink and was omitted (add --closed to include it)\n"
            )
    levels = [(series, level) for series, level in known if level is not None]
    if not levels:
        raise InputError(f"{path}: there is no blink, so the closed level is unknown: add --closed")
    return levels


def _write_text(path: Path, text: str) -> None:
    with whole_text(path) as stream:
        stream.write(text)


def _doubts(table: pd.DataFrame, eyes: Sequence[EyeBlinks]) -> list[str]:
    """What a track says about its frames, and unlikely rates."""
    lines = [*without_blinks(eyes), *rate_doubts(eyes), *speed_doubt(eyes), *eyes[0].series.notes]
    # Only tracks of this program have these columns; other tables are read without them.
    lost = int((table["status"] == "lost").sum()) if "status" in table.columns else 0
    if lost:
        lines.append(f"{lost:,} of {len(table):,} frames are lost")
    if "error_px" in table.columns and table["error_px"].notna().any():
        lines.append(f"stated error of the points, median: {table['error_px'].median():.2f} px")
    return lines


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
    # A recording may take minutes: what is wrong in the options is said first.
    _check(job)
    eyes = label_recording(job)
    reviews, decided, lost = _reviewed(job, eyes)
    eyes = [_with_moved_edges(job, eye, decided) for eye in eyes]
    # Rejected blinks stay in the table, marked, so that a decision can be taken back.
    frame = blinks_frame([blink for eye in eyes for blink in eye.blinks], decided, both_eyes(eyes))
    accepted = [_accepted_only(eye, decided) for eye in eyes]
    names = [eye_of(eye.series.column) for eye in eyes]
    profiles = all_profiles(accepted, job.series.stem, names)
    if not profiles and len(frame):
        raise InputError("the review rejects every blink, so there is nothing to write")
    for line in [*asymmetry_lines(eyes, _rejected(decided)), *speed_doubt(eyes)]:
        sys.stderr.write(f"note: {line}\n")
    summaries = [
        summarise(eye, frame, [p for p in profiles if p.eye == name and _is_of(p, eye)])
        for eye, name in zip(accepted, names, strict=True)
    ]
    written = _write(job, _LabelledRecording(eyes, frame, profiles, summaries, decided, reviews))
    print_blinks(summaries, lost, closed_given=job.closed is not None)
    print_written(len(frame), written)


@dataclass(frozen=True, eq=False)
class _LabelledRecording:
    """A labeled and reviewed recording, as it is written; `decided` and `reviews` as of `_reviewed`."""

    eyes: Sequence[EyeBlinks]
    frame: pd.DataFrame
    profiles: Sequence[BlinkProfile]
    summaries: Sequence[dict[str, Any]]
    decided: Mapping[tuple[str, int], Review]
    reviews: Sequence[Review]


def _write(job: BlinksJob, labelled: _LabelledRecording) -> list[Path | None]:
    """Write what the job asks for; without a blink the table of profiles is empty. Return the files."""
    # Computed before anything is written: a refusal here leaves all files as they were.
    more = job.more.prepared(job.series, labelled.eyes, labelled.frame, job.closed)
    _write_figures(job, labelled.eyes, labelled.decided, labelled.profiles)
    write_profile_table(job.profiles, labelled.profiles)
    if job.summary is not None:
        write_summary(job.summary, labelled.summaries)
    # A review that was only read is not written again: somebody may have it open.
    if job.review is not None and (job.reject or job.accept):
        write_reviews(job.review, labelled.reviews)
    for write in more:
        write()
    events = job.events if job.classify else None
    if events is not None:
        write_events(events, labelled.eyes)
    # The table of blinks last: where it is new, everything else is written.
    write_blinks(job.out, labelled.frame)
    # The last line names what was written, not what was asked for.
    aligned = job.plot_aligned if labelled.profiles else None
    return [job.out, job.profiles, events, *job.more.paths, job.summary, job.plot, aligned]


def label_recording(job: BlinksJob) -> list[EyeBlinks]:
    """Label every column of the job; an unlikely rate is reported.

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
    # Winks differ from blinks only in the other eye.
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
        raise InputError(f"--complete-from must be a closure above 0 and up to 1, got {job.complete_from:g}")
    if job.closed is not None and job.closed < 0:
        raise InputError(f"--closed must be a distance of 0 or more, got {job.closed:g}")
    if (job.reject or job.accept) and job.review is None:
        raise InputError("--reject and --accept need a review file: add --review FILE")
    for figure in (job.plot, job.plot_aligned):
        if figure is not None:
            check_figure_name(figure)
    job.more.check()
    _check_files(job)


def _check_files(job: BlinksJob) -> None:
    """Reject names of files that cannot be written, or that indicate another kind of file."""
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
    # A decision belongs to a moment: the numbers of blinks change with the options.
    reach = match_frames(eyes[0].series.fps)
    new = [parse_choice(text, "reject", blinks) for text in job.reject]
    new += [parse_choice(text, "accept", blinks) for text in job.accept]
    old = read_reviews(job.review) if job.review is not None else []
    if job.review is not None and not new and not job.review.exists():
        raise InputError(f"{job.review}: this review file does not exist; create it with --reject N=reason")
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
    # Rates, profiles and figures are those of accepted blinks.
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
        older = "; the existing file is from an earlier run" if job.plot_aligned.exists() else ""
        why = f"there is no blink to align{older}"
        sys.stderr.write(f"note: {job.plot_aligned} is not written: {why}\n")
    elif job.plot_aligned is not None:
        groups = {eye.series.column: [p for p in profiles if _is_of(p, eye)] for eye in eyes}
        save_figure(
            aligned_figure({name: group for name, group in groups.items() if group}), job.plot_aligned
        )
