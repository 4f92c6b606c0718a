"""What `stimuli track` does: one video, or every video of a folder."""

import sys
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from experiments.errors import InputError, counted
from experiments.files import check_ending, check_folder, check_target, check_targets
from stimuli_builder.blinks.plots import check_figure_name
from stimuli_builder.progress import frame_progress, step_progress
from stimuli_builder.tracking.labelfree import label_free_lesson, worst_frames, write_relabel
from stimuli_builder.tracking.labels import Labels, by_hand, load_labels, unmarked_note, unreviewed_note
from stimuli_builder.tracking.learn import Lesson, check_eyes, learn, open_video, training_steps
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions, load_model
from stimuli_builder.tracking.preview import plot_track, write_preview
from stimuli_builder.tracking.shapes import Points
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import TrackSummary
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import DamagedFileError, VideoInfo, check_video_name, declared_frames

# What `stimuli track` and `train` print: what a model was trained on, how a track went, warnings.

REASONS_TOLD = 6


def warn(line: str) -> None:
    """Print a warning on stderr, unless there is nothing to say."""
    if line:
        sys.stderr.write(f"warning: {line}\n")


def report_track(out: Path, summary: TrackSummary, prepared_s: float) -> None:
    """Print how many frames were tracked, doubtful and lost, how fast, and the usual reasons."""
    print(
        f"{out}: {summary.frames:,} frames, {summary.tracked:,} tracked "
        f"({summary.doubtful:,} of them doubtful), {summary.reinitialised:,} re-initialized, "
        f"{summary.lost:,} lost\n"
        f"{summary.fit_fps:,.0f} frames/s fit only, "
        f"{summary.end_to_end_fps:,.0f} frames/s with decoding; "
        f"{summary.total_s:,.1f} s after {prepared_s:,.1f} s for the model"
    )
    usual = sorted(summary.reasons.items(), key=lambda entry: -entry[1][0])
    for (status, _), (number, first, whole) in usual[:REASONS_TOLD]:
        print(f"{counted(number, 'frame')} {status}, the first is {first}: {whole}")
    if summary.tracked == summary.doubtful:
        warn("every frame is doubtful; check a --preview before you use any number")


def report_modes(lesson: Lesson) -> None:
    """Print how many frames trained and how much of their variance is kept."""
    model = lesson.model
    kept = [f"{share:.1%}" for share in model.variance_kept]
    print(
        f"trained on {len(model.examples)} frames: {model.mode_counts[0]} shape modes ({kept[0]}), "
        f"{model.mode_counts[1]} appearance modes ({kept[1]}), "
        f"{model.mode_counts[2]} coupled modes ({kept[2]}), "
        f"{model.mesh.pixel_count:,} base pixels, labels {'refined' if lesson.refined else 'as given'}"
    )


Hints = Mapping[int, Points | str]
VIDEO_SUFFIXES = {".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mts", ".mpg", ".wmv"}


@dataclass(frozen=True)
class TrackJob:
    """One call of `stimuli track`; the fields are its options."""

    video: Path
    out: Path
    options: TrainingOptions
    labels: Path | None = None
    model: Path | None = None
    relabel: Path | None = None
    one_eye: bool = False
    preview: Path | None = None
    plot: Path | None = None
    refine: bool | None = None
    folds: int = 5
    accept_variable_rate: bool = False
    accept_damaged_end: bool = False


def run_track(job: TrackJob) -> None:
    """Track one video and write the requested files; all checks come first."""
    _check(job)
    try:
        _track(job, open_video(job.video, job.accept_variable_rate, job.accept_damaged_end))
    except DamagedFileError as error:
        raise InputError(f"{error}, or track the readable part with --accept-damaged-end") from error


def _track(job: TrackJob, info: VideoInfo) -> None:
    started = time.monotonic()
    model, hints = _model(job, info)
    prepared_s = time.monotonic() - started
    with frame_progress() as progress:
        task = progress.add_task("tracking", total=info.frame_count)
        summary = track_video(
            model,
            info,
            job.out,
            lambda now: progress.update(task, completed=now.frames, refresh=False),
            hints,
        )
    report_track(job.out, summary, prepared_s)
    if summary.repeated:
        share = 1 - summary.repeated / summary.frames
        warn(
            f"{counted(summary.repeated, 'frame')} repeat the previous frame at regular intervals, as after "
            f"a change of the frame rate: about {share * info.fps:.3g} frames per second differ, not "
            f"{info.fps:.4g}"
        )
    if job.accept_damaged_end:
        _say_how_far(info)
    if job.relabel is not None:
        _relabel(job.relabel, info, model, job, hints)
    _pictures(job, info, model)


def track_folder(job: TrackJob) -> None:
    """Track every video of a folder into tracks of their names; tracks that are there already are kept.

    Raises
    ------
    InputError
        The folder holds no video, outputs of one video are asked for, or some video was refused: the others
        are tracked all the same, and each refusal is reported when it happens.
    """
    if job.labels or job.relabel or job.preview or job.plot:
        raise InputError(
            "for a folder only --model is possible: --labels, --relabel and pictures need a single video"
        )
    videos = sorted(path for path in job.video.iterdir() if path.suffix.lower() in VIDEO_SUFFIXES)
    if not videos:
        raise InputError(
            f"{job.video}: there is no video in this folder ({' '.join(sorted(VIDEO_SUFFIXES))})"
        )
    check_folder(job.out)
    job.out.mkdir(parents=True, exist_ok=True)
    namesakes = Counter(video.stem for video in videos)
    refused = 0
    for number, video in enumerate(videos, start=1):
        out = job.out / f"{video.stem if namesakes[video.stem] == 1 else video.name}.csv"
        if out.exists():
            print(f"{number}/{len(videos)} {out}: already exists")
            continue
        print(f"{number}/{len(videos)} {video.name}")
        try:
            run_track(replace(job, video=video, out=out))
        except InputError as error:
            refused += 1
            sys.stderr.write(f"error: {error}\n")
    if refused:
        raise InputError(
            f"{refused} of {len(videos)} videos could not be tracked; the others are in {job.out}"
        )


def _say_how_far(info: VideoInfo) -> None:
    """Print where a recording ends that was taken up to its damage."""
    more = "read"
    if info.damaged:
        declared = declared_frames(info)
        of = f"of about {declared:,} declared" if declared > info.frame_count else "before the damage"
        more = f"{of}; the rest could not be read"
    print(f"{info.path}: {info.frame_count:,} frames ({info.times_s[-1]:.2f} s) {more}")


def _check(job: TrackJob) -> None:
    if job.labels is not None and job.model is not None:
        raise InputError("use --labels or --model, not both")
    if job.relabel is not None and (job.labels is not None or job.model is not None):
        raise InputError("--relabel is for tracking without --labels and --model; remove them")
    if job.relabel is not None:
        check_target(job.relabel)
    check_targets([job.out, job.preview, job.plot], [job.video, job.labels, job.model, job.relabel])
    check_ending(job.out, (".csv",), "a track")
    if job.relabel is not None:
        check_ending(job.relabel, (".json",), "the label file of --relabel")
    if job.preview is not None:
        check_video_name(job.preview)
    if job.plot is not None:
        check_figure_name(job.plot)


def _model(job: TrackJob, info: VideoInfo) -> tuple[CoupledModel, Hints]:
    """A model from labels, from a file, or from what the detector sees; then with its detections."""
    if job.labels is not None:
        warn(unreviewed_note(load_labels(job.labels)))
        with step_progress("training", training_steps(job.folds, job.refine)) as advance:
            lesson = learn(
                info,
                job.labels,
                job.options,
                one_eye=job.one_eye,
                folds=job.folds,
                refine=job.refine,
                advance=advance,
            )
        report_modes(lesson)
        return lesson.model, {}
    if job.model is None:
        return _label_free(job, info)
    model = load_model(job.model)
    if job.one_eye and model.eyes == 2:
        raise InputError(f"{job.model}: this is a model of two eyes; remove --one-eye")
    return model, {}


def _label_free(job: TrackJob, info: VideoInfo) -> tuple[CoupledModel, Hints]:
    hand = _by_hand(job, info)
    with frame_progress() as progress:
        task = progress.add_task("finding eyes", total=info.frame_count)
        seen = survey(info, one_eye=job.one_eye, advance=lambda now: progress.update(task, completed=now))
    line = f"eyes found on {len(seen.points):,} of {seen.looked_at:,} frames looked at"
    more = (
        f"; {seen.several_faces:,} show several faces; the largest over the recording was used"
        if seen.several_faces
        else ""
    )
    if seen.further:
        more += f"; {counted(seen.further, 'smaller face')} more, detected only in parts of the picture"
    print(f"{line}{more}; training on them", flush=True)
    with step_progress("training", training_steps(refine=job.refine)) as advance:
        lesson = label_free_lesson(
            info, seen, job.options, one_eye=job.one_eye, by_hand=hand, refine=job.refine, advance=advance
        )
    report_modes(lesson)
    return lesson.model, seen.hints


def _by_hand(job: TrackJob, info: VideoInfo) -> Labels | None:
    """What a person changed or accepted in the file to relabel; None where there is no file yet."""
    if job.relabel is None or not job.relabel.exists():
        return None
    labels = load_labels(job.relabel, info.size_px, info.frame_count, fewest=1)
    check_eyes(labels, job.one_eye)
    warn(unmarked_note(labels))
    return by_hand(labels)


def _relabel(path: Path, info: VideoInfo, model: CoupledModel, job: TrackJob, hints: Hints) -> None:
    hand = by_hand(load_labels(path, fewest=1)).frames if path.exists() else {}
    proposed = write_relabel(
        path, info, model.markers, worst_frames(job.out, model.eyes, info.fps, hints), hand
    )
    count = "counts" if len(hand) == 1 else "count"
    print(
        f"{path}: {counted(len(hand), 'frame')} corrected or accepted, which {count}; {proposed} as "
        "proposed, which do not: correct or accept them on the labeling page, then run this command again"
    )


def _pictures(job: TrackJob, info: VideoInfo, model: CoupledModel) -> None:
    if job.preview is not None:
        with frame_progress() as progress:
            task = progress.add_task("preview", total=info.frame_count)
            write_preview(model, info, job.out, job.preview, lambda: progress.advance(task))
        print(f"{job.preview}: preview written")
    if job.plot is not None:
        _plot(job.out, info.fps, job.plot)


def _plot(track: Path, fps: float, figure: Path) -> None:
    """Plot a written track; one in which blinks cannot be detected has no plot, with a message."""
    try:
        count = plot_track(track, fps, figure)
    except InputError as error:
        warn(f"{figure}: the track was written, but not the plot ({error})")
        return
    print(f"{figure}: trace with {counted(count, 'blink')}")
