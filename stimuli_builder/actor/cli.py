"""`stimuli actor`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.errors import counted

if TYPE_CHECKING:
    from stimuli_builder.actor.recording import Actor


def register(app: typer.Typer) -> None:
    """Add the commands of the synthetic actor to `app`."""
    app.command()(actor)


def actor(
    out: Annotated[Path, typer.Option(help="Video to write (MP4, H.264, 512 x 384).")],
    truth: Annotated[Path | None, typer.Option(help="Exact ground truth of every frame (CSV).")] = None,
    labels: Annotated[
        Path | None, typer.Option(help="Label file of frames chosen for variety (JSON).")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Length of the recording in seconds.")] = 20.0,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 300.0,
    seed: Annotated[
        int, typer.Option(help="Random seed; the same seed gives the same face and recording.", min=0)
    ] = 1,
    noise: Annotated[float, typer.Option(help="Sensor noise, SD in gray levels.")] = 2.0,
    label_frames: Annotated[int, typer.Option(help="Frames in the label file.", min=3, max=500)] = 20,
    label_noise: Annotated[
        float, typer.Option(help="Error of the labels, SD of x and y in pixels.", min=0)
    ] = 0.0,
) -> None:
    """Generate a high-speed recording of a synthetic actor, with exact ground truth and label files.

    Blinks, head drift, gaze, light and sensor noise follow published statistics. The truth has the columns of
    a track up to the distances, then closure (0 open, 1 closed, mean of both eyes), blink (number from 1,
    empty between blinks) and phase (open, down, up).

    Examples:

      stimuli actor --seconds 20 --fps 300 --seed 1 --out actor.mp4 --truth truth.csv --labels labels.json

      stimuli actor --seconds 120 --out actor.mp4 --labels labels.json --label-noise 1
    """
    from experiments.files import as_argument, check_targets
    from stimuli_builder.actor.recording import Actor, ActorOptions, write_truth, write_video
    from stimuli_builder.progress import frame_progress
    from stimuli_builder.video import check_video_name

    options = ActorOptions(seconds, fps, seed, noise)
    check_targets([out, truth, labels])
    check_video_name(out)
    person = Actor(options)
    with frame_progress() as progress:
        task = progress.add_task("drawing", total=options.frame_count)
        write_video(person, out, lambda: progress.advance(task))
    print(
        f"{out}: {counted(options.frame_count, 'frame')} at {fps:g} frames/s, "
        f"{counted(int(person.course.blink.max()), 'blink')}"
    )
    if truth is not None:
        write_truth(person, truth)
        print(f"{truth}: truth of every frame")
    if labels is not None:
        _save_labels(person, labels, out.name, label_frames, label_noise)
        track = f"stimuli track {as_argument(out)} --labels {as_argument(labels)} --out track.csv"
        print(f"track it with: {track}")


def _save_labels(person: "Actor", path: Path, video: str, count: int, noise: float) -> None:
    from stimuli_builder.actor.face import PICTURE_SIZE
    from stimuli_builder.actor.recording import label_points
    from stimuli_builder.tracking.labels import Labels, save_labels
    from stimuli_builder.tracking.shapes import default_markers

    frames = label_points(person, count, noise)
    save_labels(
        Labels(path, PICTURE_SIZE, default_markers(2), frames),
        video,
        f"synthetic actor, label noise sd {noise:g} px",
    )
    print(f"{path}: {len(frames)} labeled frames")
