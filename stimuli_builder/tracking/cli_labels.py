"""`stimuli label`, `stimuli accuracy` and `stimuli iris`."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command()(accuracy)
    app.command()(label)
    app.command()(iris)


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
    one_eye: Annotated[
        bool, typer.Option("--one-eye", help="Close-up of one eye: 9 points a frame.")
    ] = False,
    frames: Annotated[int, typer.Option(help="Frames to label, chosen for variety.", min=3, max=200)] = 20,
    accept_variable_rate: Annotated[
        bool, typer.Option("--accept-variable-rate", help="Take a variable frame rate.")
    ] = False,
) -> None:
    """Propose labels for frames chosen for variety, with the eye detector, to be corrected by hand.

    The detector's environment (270 MB) is made at first use. Upper-lid points of half-closed lids can be 1
    to 2 pixels off: review every frame on the labelling page before training.

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
    video: Annotated[Path, typer.Argument(help="Recording that was tracked.")],
    track: Annotated[Path, typer.Argument(help="Its track (CSV of 'stimuli track').")],
    out: Annotated[Path, typer.Option(help="Table of the irises to write (CSV).")],
) -> None:
    """Measure the irises of a tracked recording, and the millimetres in a pixel that follow.

    Middle and diameter of each iris in pixels, empty where the eye is shut or doubtful, or no edge is seen.

    Example:

      stimuli iris face.mp4 track.csv --out iris.csv
    """
    from experiments.files import check_ending, check_targets
    from stimuli_builder.progress import frame_progress
    from stimuli_builder.tracking.iris import IRIS_MM
    from stimuli_builder.tracking.iris_table import write_irises
    from stimuli_builder.tracking.learn import open_video

    check_targets([out], [video, track])
    check_ending(out, (".csv",), "the table of irises")
    info = open_video(video, accept_variable_rate=True)
    with frame_progress() as progress:
        task = progress.add_task("irises", total=info.frame_count)
        summary = write_irises(info, track, out, lambda: progress.advance(task))
    print(f"{out}: {summary.seen:,} irises seen in {summary.frames:,} frames")
    if summary.diameter_px > 0:
        print(
            f"median diameter {summary.diameter_px:.2f} px (middle half within {summary.spread_px:.2f} px): "
            f"{summary.mm_per_px:.4f} mm in a pixel if an iris is {IRIS_MM:g} mm wide\n"
            f"use it with: stimuli blinks {track} --scale {summary.mm_per_px:.4f}"
        )
    else:
        print("too few irises to tell how many millimetres a pixel is")
