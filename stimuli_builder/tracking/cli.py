"""`stimuli track` and `stimuli train`; `stimuli label` and `stimuli accuracy` live in cli_labels.py."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from stimuli_builder.tracking.labels import Labels
    from stimuli_builder.tracking.learn import Lesson
    from stimuli_builder.tracking.model import CoupledModel, TrainingOptions
    from stimuli_builder.tracking.shapes import Points
    from stimuli_builder.video import VideoInfo

Video = Annotated[
    Path, typer.Argument(help="Recording: anything PyAV reads, colour or grey, upright or rotated.")
]
LabelFile = Annotated[
    Path | None, typer.Option("--labels", help="Label file (JSON) of about 20 frames of VIDEO.")
]
OneEye = Annotated[bool, typer.Option("--one-eye", help="Close-up of one eye: 9 points a frame.")]
ShapeVariance = Annotated[
    float, typer.Option(help="Share of shape variance kept (n modes).", min=0.5, max=1.0)
]
LookVariance = Annotated[
    float, typer.Option(help="Share of appearance variance kept (m modes).", min=0.5, max=1.0)
]
CoupledVariance = Annotated[
    float, typer.Option(help="Share of coupled variance kept (l modes).", min=0.5, max=1.0)
]
FewestModes = Annotated[
    bool, typer.Option("--paper-modes/--variance-only", help="Keep at least the paper's 8, 10 and 10 modes.")
]
BasePixels = Annotated[int, typer.Option(help="Pixels of the base mesh.", min=500, max=100_000)]
Refine = Annotated[
    bool | None,
    typer.Option(
        "--refine/--no-refine", help="Make labels consistent with the pictures; unset: where it helps."
    ),
]
Folds = Annotated[int, typer.Option(help="Folds of the accuracy report.", min=2, max=50)]
VariableRate = Annotated[
    bool, typer.Option("--accept-variable-rate", help="Take a variable frame rate, with its own time stamps.")
]


def register(app: typer.Typer) -> None:
    """Add the commands of the tracker to `app`."""
    from stimuli_builder.tracking.cli_labels import register as register_labels

    app.command()(track)
    app.command()(train)
    register_labels(app)


def track(
    video: Video,
    out: Annotated[Path, typer.Option(help="Track to write (CSV).")],
    labels: LabelFile = None,
    model: Annotated[
        Path | None, typer.Option(help="Reuse a model of 'stimuli train' instead of labels.")
    ] = None,
    one_eye: OneEye = False,
    preview: Annotated[
        Path | None, typer.Option(help="Also draw mesh and distance trace on the video (MP4).")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Also save the trace with labelled blinks (PNG, SVG, PDF).")
    ] = None,
    shape_variance: ShapeVariance = 0.98,
    appearance_variance: LookVariance = 0.90,
    coupled_variance: CoupledVariance = 0.98,
    paper_modes: FewestModes = True,
    base_pixels: BasePixels = 6500,
    refine: Refine = None,
    folds: Folds = 5,
    accept_variable_rate: VariableRate = False,
    relabel: Annotated[
        Path | None,
        typer.Option(
            help="Label file for the worst frames, to be corrected by hand; where it is there, its frames "
            "train the model and win over the detector."
        ),
    ] = None,
) -> None:
    """Track the eyelids of a recording with the coupled active appearance model.

    Without labels a face detector finds the eyes and trains the model (its environment, 270 MB, is made at
    first use); labels placed by hand (--labels) are more exact.

    Writes one row a frame: frame, time_s, x01, y01 ... x18, y18, left_distance_px, right_distance_px (with
    --one-eye 9 points and distance_px), residual, iterations, error_px, e01 ... e18, status, reason. A frame
    that cannot be fitted has empty points, the status 'lost' and its reason; one that may be wrong is
    'doubtful'.

    Examples:

      stimuli track face.mp4 --out track.csv

      stimuli track eye.mp4 --one-eye --out track.csv --preview seen.mp4

      stimuli track face.mp4 --out track.csv --relabel worst.json    # correct worst.json, run it again

      stimuli track face.mp4 --labels face.labels.json --out track.csv

      stimuli track eye.mp4 --labels eye.labels.json --one-eye --out track.csv --preview seen.mp4

      stimuli track take2.mp4 --model actor1.npz --out track2.csv --plot track2.png
    """
    from experiments.errors import InputError
    from stimuli_builder.progress import frame_progress
    from stimuli_builder.tracking.learn import open_video
    from stimuli_builder.tracking.track import track_video

    if labels is not None and model is not None:
        raise InputError("expected --labels or --model, or neither; give one of them")
    if relabel is not None and (labels is not None or model is not None):
        raise InputError("--relabel belongs to tracking without --labels and --model; leave them out")
    _check_outputs([video, labels, model, relabel], out, preview, plot)
    info = open_video(video, accept_variable_rate)
    options = _options(shape_variance, appearance_variance, coupled_variance, paper_modes, base_pixels)
    hints: Mapping[int, Points] = {}
    if labels is None and model is None:
        trained, hints = _label_free(info, options, one_eye, relabel)
    else:
        trained = _model(info, labels, model, options, one_eye, refine, folds)
    with frame_progress() as progress:
        task = progress.add_task("tracking", total=info.frame_count)
        summary = track_video(
            trained,
            info,
            out,
            lambda now: progress.update(task, completed=now.frames, refresh=False),
            hints,
        )
    print(
        f"{out}: {summary.frames:,} frames, {summary.tracked:,} tracked "
        f"({summary.doubtful:,} of them doubtful), {summary.reinitialised:,} re-initialised, "
        f"{summary.lost:,} lost\n"
        f"{summary.fit_fps:,.0f} frames/s fit only, "
        f"{summary.end_to_end_fps:,.0f} frames/s with decoding"
    )
    if relabel is not None:
        _relabel(relabel, info, trained, out, hints)
    _pictures(trained, info, out, preview, plot)


def train(
    video: Video,
    labels: LabelFile = None,
    out: Annotated[Path | None, typer.Option(help="Model to write (.npz).")] = None,
    one_eye: OneEye = False,
    shape_variance: ShapeVariance = 0.98,
    appearance_variance: LookVariance = 0.90,
    coupled_variance: CoupledVariance = 0.98,
    paper_modes: FewestModes = True,
    base_pixels: BasePixels = 6500,
    refine: Refine = None,
    folds: Folds = 5,
    accept_variable_rate: VariableRate = False,
) -> None:
    """Train the model on labelled frames, report its accuracy by fold, and save it.

    Every labelled frame is left out of training once and then found without its label. The report gives the
    root mean square distance of the landmarks from the labels and the error of the inter-eyelid distance.

    Examples:

      stimuli train face.mp4 --labels face.labels.json --out actor1.npz

      stimuli train eye.mp4 --labels eye.labels.json --one-eye --folds 8
    """
    from experiments.errors import InputError
    from stimuli_builder.files import check_targets
    from stimuli_builder.tracking.learn import learn, open_video
    from stimuli_builder.tracking.model import save_model

    if labels is None:
        raise InputError("expected --labels with the label file of this video")
    check_targets([out], [video, labels])
    info = open_video(video, accept_variable_rate)
    options = _options(shape_variance, appearance_variance, coupled_variance, paper_modes, base_pixels)
    lesson = learn(info, labels, options, one_eye=one_eye, folds=folds, refine=refine)
    _report_modes(lesson)
    _report_folds(lesson)
    if out is not None:
        save_model(lesson.model, out)
        print(f"{out}: model saved")


def _options(
    shape: float, look: float, coupled: float, paper_modes: bool, base_pixels: int
) -> "TrainingOptions":
    from stimuli_builder.tracking.model import TrainingOptions

    if paper_modes:
        return TrainingOptions(shape, look, coupled, base_pixels=base_pixels)
    return TrainingOptions(shape, look, coupled, 1, 1, 1, base_pixels)


def _model(
    info: "VideoInfo",
    labels: Path | None,
    model: Path | None,
    options: "TrainingOptions",
    one_eye: bool,
    refine: bool | None,
    folds: int,
) -> "CoupledModel":
    """Train from labels, or load a model and check that it is for as many eyes as wanted."""
    from experiments.errors import InputError
    from stimuli_builder.tracking.learn import learn
    from stimuli_builder.tracking.model import load_model

    if labels is not None:
        lesson = learn(info, labels, options, one_eye=one_eye, folds=folds, refine=refine)
        _report_modes(lesson)
        return lesson.model
    if model is None:
        raise InputError("expected --labels or --model")
    trained = load_model(model)
    if one_eye and trained.eyes == 2:
        raise InputError(f"{model}: a model of two eyes, --one-eye expects one; leave --one-eye out")
    return trained


def _by_hand(path: Path | None, info: "VideoInfo") -> "Labels | None":
    from stimuli_builder.tracking.labels import load_labels

    return load_labels(path, info.size_px, info.frame_count) if path is not None and path.exists() else None


def _relabel(
    path: Path, info: "VideoInfo", model: "CoupledModel", out: Path, hints: "Mapping[int, Points]"
) -> None:
    from stimuli_builder.tracking.relabel import worst_frames, write_relabel

    before = _by_hand(path, info)
    worst = worst_frames(out, model.eyes, info.fps, hints)
    new = write_relabel(path, info, model.markers, worst, {} if before is None else before.frames)
    print(f"{path}: {new} frames to correct on the labelling page; run the same command again then")


def _label_free(
    info: "VideoInfo", options: "TrainingOptions", one_eye: bool, relabel: Path | None
) -> "tuple[CoupledModel, Mapping[int, Points]]":
    """Find the eyes by the detector and train on what it saw."""
    from stimuli_builder.progress import frame_progress
    from stimuli_builder.tracking.labelfree import label_free_lesson, survey

    with frame_progress() as progress:
        task = progress.add_task("finding eyes", total=info.frame_count)
        seen = survey(info, one_eye=one_eye, advance=lambda now: progress.update(task, completed=now))
    found = f"eyes found on {len(seen.points):,} of {seen.looked_at:,} frames looked at"
    more = f"; {seen.several_faces:,} show several faces, the largest is taken" if seen.several_faces else ""
    print(found + more)
    by_hand = _by_hand(relabel, info)
    lesson = label_free_lesson(info, seen, options, one_eye=one_eye, by_hand=by_hand)
    _report_modes(lesson)
    return lesson.model, seen.points


def _check_outputs(
    inputs: "Sequence[Path | None]", out: Path, preview: Path | None, plot: Path | None
) -> None:
    from stimuli_builder.files import check_targets

    check_targets([out, preview, plot], inputs)
    if preview is not None:
        from stimuli_builder.video_writer import check_video_name

        check_video_name(preview)
    if plot is not None:
        from stimuli_builder.blinks.plots import check_figure_name

        check_figure_name(plot)


def _pictures(
    model: "CoupledModel", info: "VideoInfo", out: Path, preview: Path | None, plot: Path | None
) -> None:
    if preview is not None:
        from stimuli_builder.progress import frame_progress
        from stimuli_builder.tracking.preview import write_preview

        with frame_progress() as progress:
            task = progress.add_task("preview", total=info.frame_count)
            write_preview(model, info, out, preview, lambda: progress.advance(task))
        print(f"{preview}: preview written")
    if plot is not None:
        from stimuli_builder.tracking.plot import plot_track

        found = plot_track(out, info.fps, plot)
        print(f"{plot}: trace with {found} blinks")


def _report_modes(lesson: "Lesson") -> None:
    model = lesson.model
    kept = [f"{share:.1%}" for share in model.variance_kept]
    print(
        f"trained on {len(model.examples)} frames: {model.mode_counts[0]} shape modes ({kept[0]}), "
        f"{model.mode_counts[1]} appearance modes ({kept[1]}), "
        f"{model.mode_counts[2]} coupled modes ({kept[2]}), "
        f"{model.mesh.pixel_count:,} base pixels, labels {'refined' if lesson.refined else 'as given'}"
    )


def _report_folds(lesson: "Lesson") -> None:
    from stimuli_builder.tracking.report import fold_lines

    for line in fold_lines(lesson.held_out):
        print(line)
