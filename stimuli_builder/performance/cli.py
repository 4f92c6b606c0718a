"""`stimuli performance`: from speech to a whole performance of the eyelids."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add `stimuli performance` to `app`."""
    app.command("performance")(performance)


def performance(
    source: Annotated[
        Path | None,
        typer.Argument(help="A recording with sound (WAV, MP3, a video, ...) or subtitles (.vtt, .srt)."),
    ] = None,
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("performance.csv"),
    format_name: Annotated[
        str, typer.Option("--format", help="csv, json, blender, maya, arkit, gltf or usd.")
    ] = "csv",
    fps: Annotated[float, typer.Option(help="Frame rate of the curves.")] = 60.0,
    seed: Annotated[
        int, typer.Option(help="The same seed gives the same blinks; speakers differ with one seed too.")
    ] = 1,
    state: Annotated[
        str,
        typer.Option(
            help="What the person does while not speaking: rest, reading, screen, speaking, listening."
        ),
    ] = "listening",
    duration: Annotated[
        float | None, typer.Option(help="Length in seconds; the recording's without it.")
    ] = None,
    speaker: Annotated[
        str | None, typer.Option(help="Of subtitles with voices (<v Name>), whose eyes these are.")
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Blinks a minute in --state, instead of the published mean.")
    ] = None,
    target: Annotated[str, typer.Option(help="Object (Blender) or node (Maya) that has the shapes.")] = "",
    left: Annotated[str, typer.Option(help="Name of the left eye's shape or attribute.")] = "eyeBlinkLeft",
    right: Annotated[str, typer.Option(help="Name of the right eye's.")] = "eyeBlinkRight",
) -> None:
    """Write the blinks of a whole performance, timed by pauses and turns of speech.

    Examples:

      stimuli performance speech.wav --out blinks.py --format blender --fps 24

      stimuli performance dialogue.vtt --speaker Anna --out anna.csv --format arkit

      stimuli performance --duration 60 --state reading --out reading.json --format json
    """
    from stimuli_builder.blinks.export import CurveTarget
    from stimuli_builder.performance.run import PerformanceJob, write_performance

    write_performance(
        PerformanceJob(
            out,
            source,
            format_name,
            fps,
            seed,
            state,
            duration,
            speaker,
            rate,
            CurveTarget(target, left, right),
        )
    )
