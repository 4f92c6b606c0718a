"""`stimuli label` and `stimuli accuracy`."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command()(accuracy)
    app.command()(label)


def accuracy(
    track: Annotated[Path, typer.Argument(help="Track of the synthetic actor (CSV).")],
    truth: Annotated[Path, typer.Argument(help="Truth that 'stimuli actor' wrote (CSV).")],
) -> None:
    """Compare a track of the synthetic actor with its exact truth.

    Example:

      stimuli accuracy track.csv truth.csv
    """
    from stimuli_builder.tracking.accuracy import compare_with_truth

    report = compare_with_truth(track, truth)
    blinks = "no blink" if report.blink_p95_px is None else f"{report.blink_p95_px:.3f} px in blinks"
    print(
        f"{report.frames:,} frames, {report.lost:,} lost, {report.reinitialised:,} re-initialised\n"
        f"landmarks: RMS {report.rms_px:.3f} px, 95th percentile {report.p95_px:.3f} px, {blinks}\n"
        f"inter-eyelid distance: error sd {report.distance_sd_px:.3f} px, "
        f"bias {report.distance_bias_px:+.3f} px"
    )


def label(
    video: Annotated[Path, typer.Argument(help="Recording of a face.")],
    out: Annotated[Path, typer.Option(help="Label file to write (JSON), to be corrected by hand.")],
    bootstrap: Annotated[
        bool, typer.Option("--bootstrap", help="Propose labels with a landmark detector.")
    ] = False,
    weights: Annotated[
        Path | None, typer.Option(help="Weights of the detector (face_landmarker.task); none are shipped.")
    ] = None,
    frames: Annotated[int, typer.Option(help="Frames to label, chosen for variety.", min=3, max=200)] = 20,
    accept_variable_rate: Annotated[
        bool, typer.Option("--accept-variable-rate", help="Take a variable frame rate.")
    ] = False,
) -> None:
    """Propose labels for frames chosen for variety, with a face landmark detector (optional extra).

    Needs MediaPipe (pip install 'mediapipe>=1.2') and a weights file of your own. A detector sets upper-lid
    points 1 to 2 pixels low on half-closed lids: review every frame on the labelling page before training.

    Example:

      stimuli label face.mp4 --bootstrap --weights face_landmarker.task --out face.labels.json
    """
    from experiments.errors import InputError
    from stimuli_builder.files import check_targets
    from stimuli_builder.tracking.bootstrap import propose_labels
    from stimuli_builder.tracking.learn import open_video

    if not bootstrap:
        raise InputError("expected --bootstrap; to label by hand use the labelling page of the admin site")
    check_targets([out], [video, weights])
    info = open_video(video, accept_variable_rate)
    labels = propose_labels(info, out, weights, frames)
    print(f"{out}: {len(labels.frames)} frames proposed; review each one before training")
