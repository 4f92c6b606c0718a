"""`stimuli track`, `train`, `label`, `accuracy` and `iris`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from stimuli_builder.tracking.learn import Lesson
    from stimuli_builder.tracking.model import TrainingOptions


# `stimuli track` and `stimuli train`.

Video = Annotated[
    Path, typer.Argument(help="Video that PyAV can read, in color or gray, upright or rotated.")
]
LabelFile = Annotated[
    Path | None, typer.Option("--labels", help="Label file (JSON) of about 20 frames of VIDEO.")
]
OneEye = Annotated[bool, typer.Option("--one-eye", help="Close-up of one eye: 9 points per frame.")]
ShapeVariance = Annotated[
    float, typer.Option(help="Proportion of shape variance kept (n modes).", min=0.5, max=1.0)
]
LookVariance = Annotated[
    float, typer.Option(help="Proportion of appearance variance kept (m modes).", min=0.5, max=1.0)
]
CoupledVariance = Annotated[
    float, typer.Option(help="Proportion of coupled variance kept (l modes).", min=0.5, max=1.0)
]
FewestModes = Annotated[
    bool, typer.Option("--paper-modes/--variance-only", help="Keep at least the paper's 8, 10 and 10 modes.")
]
BasePixels = Annotated[int, typer.Option(help="Pixels of the base mesh.", min=500, max=100_000)]
Refine = Annotated[
    bool | None,
    typer.Option(
        "--refine/--no-refine", help="Make labels consistent with the pictures. Default: if it helps."
    ),
]
Folds = Annotated[int, typer.Option(help="Number of folds of the accuracy report.", min=2, max=50)]
VariableRate = Annotated[
    bool, typer.Option("--accept-variable-rate", help="Accept a variable frame rate, with its time stamps.")
]
DamagedEnd = Annotated[
    bool,
    typer.Option(
        "--accept-damaged-end",
        help="Track a truncated or damaged file up to the first frame that cannot be read.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the commands of the tracker to `app`."""

    app.command()(track)
    app.command()(train)
    register_labels(app)


def track(
    video: Video,
    out: Annotated[
        Path, typer.Option(help=("Track to write (CSV), or the output folder if the input is a folder."))
    ],
    labels: LabelFile = None,
    model: Annotated[
        Path | None, typer.Option(help="Use a model from 'stimuli train' instead of labels.")
    ] = None,
    one_eye: OneEye = False,
    preview: Annotated[
        Path | None, typer.Option(help="Also draw the mesh and the distance trace on the video (MP4).")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Also plot the trace with the detected blinks (PNG, SVG, PDF).")
    ] = None,
    shape_variance: ShapeVariance = 0.98,
    appearance_variance: LookVariance = 0.90,
    coupled_variance: CoupledVariance = 0.98,
    paper_modes: FewestModes = True,
    base_pixels: BasePixels = 6500,
    refine: Refine = None,
    folds: Folds = 5,
    accept_variable_rate: VariableRate = False,
    accept_damaged_end: DamagedEnd = False,
    relabel: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Label file for the worst frames, to be corrected by hand. If it exists, its corrected or "
                "accepted frames train the model and override the detector."
            )
        ),
    ] = None,
) -> None:
    """Track the eyelids in a recording with the coupled active appearance model.

    Without labels, a face detector finds the eyes and trains the model (its environment, 270 MB, is installed
    on first use). Labels placed by hand (--labels) are more accurate.

    Writes one row per frame: frame, time_s, x01, y01 ... x18, y18, left_distance_px, right_distance_px (sides
    of the picture: left is the person's right eye, unless it is mirrored; with --one-eye 9 points and
    distance_px), residual, iterations, error_px, e01 ... e18, status, reason. A frame
    that cannot be fitted has empty points, the status 'lost' and its reason; one that may be wrong is
    'doubtful'.

    Examples:

      stimuli track face.mp4 --out track.csv

      stimuli track eye.mp4 --one-eye --out track.csv --preview seen.mp4

      stimuli track face.mp4 --out track.csv --relabel worst.json    # correct worst.json, run it again

      stimuli track face.mp4 --labels face.labels.json --out track.csv

      stimuli track eye.mp4 --labels eye.labels.json --one-eye --out track.csv --preview seen.mp4

      stimuli track take2.mp4 --model actor1.npz --out track2.csv --plot track2.png

      stimuli track recordings/ --out tracks/    # every video in a folder; existing tracks are kept
    """
    from stimuli_builder.tracking.cli_track import TrackJob, run_track, track_folder

    job = TrackJob(
        video=video,
        out=out,
        options=_options(shape_variance, appearance_variance, coupled_variance, paper_modes, base_pixels),
        labels=labels,
        model=model,
        relabel=relabel,
        one_eye=one_eye,
        preview=preview,
        plot=plot,
        refine=refine,
        folds=folds,
        accept_variable_rate=accept_variable_rate,
        accept_damaged_end=accept_damaged_end,
    )
    if video.is_dir():
        track_folder(job)
    else:
        run_track(job)


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
    """Train the model on labeled frames, report its accuracy per fold, and save it.

    Every labeled frame is left out of training once and then found without its label. The report gives the
    root mean square distance of the landmarks from the labels and the error of the inter-eyelid distance.

    Examples:

      stimuli train face.mp4 --labels face.labels.json --out actor1.npz

      stimuli train eye.mp4 --labels eye.labels.json --one-eye --folds 8
    """
    from experiments.errors import InputError
    from experiments.files import check_ending, check_targets
    from stimuli_builder.progress import step_progress
    from stimuli_builder.tracking.cli_track import report_modes, warn
    from stimuli_builder.tracking.labels import load_labels, unreviewed_note
    from stimuli_builder.tracking.learn import learn, open_video, training_steps
    from stimuli_builder.tracking.model import save_model

    if labels is None:
        raise InputError("add --labels with the label file of this video")
    check_targets([out], [video, labels])
    if out is not None:
        check_ending(out, (".npz",), "a model")
    info = open_video(video, accept_variable_rate)
    warn(unreviewed_note(load_labels(labels)))
    options = _options(shape_variance, appearance_variance, coupled_variance, paper_modes, base_pixels)
    with step_progress("training", training_steps(folds, refine)) as advance:
        lesson = learn(info, labels, options, one_eye=one_eye, folds=folds, refine=refine, advance=advance)
    report_modes(lesson)
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


def _report_folds(lesson: "Lesson") -> None:
    from stimuli_builder.tracking.learn import fold_lines

    for line in fold_lines(lesson.held_out):
        print(line)


# `stimuli label`, `stimuli accuracy` and `stimuli iris`.


def register_labels(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command()(accuracy)
    app.command()(label)
    app.command()(iris)


def accuracy(
    track: Annotated[Path, typer.Argument(help="Track of the synthetic actor (CSV).")],
    truth: Annotated[Path, typer.Argument(help="Truth that 'stimuli actor' wrote (CSV).")],
) -> None:
    """Compare a track of the synthetic actor with its exact ground truth.

    Example:

      stimuli accuracy track.csv truth.csv
    """
    from stimuli_builder.tracking.accuracy import compare_with_truth

    report = compare_with_truth(track, truth)
    blinks = "no blink" if report.blink_p95_px is None else f"{report.blink_p95_px:.3f} px in blinks"
    print(
        f"{report.frames:,} frames, {report.lost:,} lost, {report.reinitialised:,} re-initialized\n"
        f"landmarks: RMS {report.rms_px:.3f} px, 95th percentile {report.p95_px:.3f} px, {blinks}\n"
        f"inter-eyelid distance: error sd {report.distance_sd_px:.3f} px, "
        f"bias {report.distance_bias_px:+.3f} px"
    )


def label(
    video: Annotated[Path, typer.Argument(help="Recording of a face.")],
    out: Annotated[Path, typer.Option(help="Label file to write (JSON), for correction by hand.")],
    one_eye: Annotated[
        bool, typer.Option("--one-eye", help="Close-up of one eye: 9 points per frame.")
    ] = False,
    frames: Annotated[int, typer.Option(help="Number of varied frames to label.", min=3, max=200)] = 20,
    accept_variable_rate: Annotated[
        bool, typer.Option("--accept-variable-rate", help="Accept a variable frame rate.")
    ] = False,
) -> None:
    """Propose labels for varied frames with the eye detector, for correction by hand.

    The detector's environment (270 MB) is installed on first use. Upper-lid points of half-closed lids can be
    1 to 2 pixels off: review every frame on the labeling page before training.

    Examples:

      stimuli label face.mp4 --out face.labels.json

      stimuli label eye.mp4 --one-eye --frames 25 --out eye.labels.json
    """
    from experiments.files import check_ending, check_targets
    from stimuli_builder.progress import frame_progress
    from stimuli_builder.tracking.labelfree import proposed_labels
    from stimuli_builder.tracking.learn import open_video
    from stimuli_builder.tracking.survey import survey

    check_targets([out], [video])
    check_ending(out, (".json",), "a label file")
    info = open_video(video, accept_variable_rate)
    with frame_progress() as progress:
        task = progress.add_task("finding eyes", total=info.frame_count)
        seen = survey(info, one_eye=one_eye, advance=lambda now: progress.update(task, completed=now))
    labels = proposed_labels(info, seen, out, frames)
    print(f"{out}: {len(labels.frames)} frames proposed; review each one before training")


def iris(
    video: Annotated[Path, typer.Argument(help="The tracked recording.")],
    track: Annotated[Path, typer.Argument(help="Its track (CSV of 'stimuli track').")],
    out: Annotated[Path, typer.Option(help="Table of the irises to write (CSV).")],
) -> None:
    """Measure the irises in a tracked recording, and estimate the millimeters per pixel.

    Center and diameter of each iris in pixels; empty if the eye is shut or doubtful, or no edge is visible.

    Example:

      stimuli iris face.mp4 track.csv --out iris.csv
    """
    from experiments.files import as_argument, check_ending, check_targets
    from stimuli_builder.progress import frame_progress
    from stimuli_builder.tracking.iris import IRIS_MM, write_irises
    from stimuli_builder.tracking.learn import open_video

    check_targets([out], [video, track])
    check_ending(out, (".csv",), "the table of irises")
    info = open_video(video, accept_variable_rate=True)
    with frame_progress() as progress:
        task = progress.add_task("irises", total=info.frame_count)
        summary = write_irises(info, track, out, lambda: progress.advance(task))
    print(f"{out}: {summary.seen:,} irises measured in {summary.frames:,} frames")
    if summary.diameter_px > 0:
        print(
            f"median diameter {summary.diameter_px:.2f} px (middle half within {summary.spread_px:.2f} px): "
            f"{summary.mm_per_px:.4f} mm per pixel if an iris is {IRIS_MM:g} mm wide\n"
            f"use it with: stimuli blinks {as_argument(track)} --scale {summary.mm_per_px:.4f} "
            "--out blinks.csv"
        )
    else:
        print("too few irises to estimate the millimeters per pixel")
