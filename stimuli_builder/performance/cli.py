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
        str,
        typer.Option("--format", help="csv, json, blender, maya, arkit, gltf, usd, liveportrait, ditto."),
    ] = "csv",
    fps: Annotated[float, typer.Option(help="Frame rate of the curves.")] = 60.0,
    seed: Annotated[
        int,
        typer.Option(
            help=("Random seed; the same seed gives the same blinks. Speakers differ even with one seed.")
        ),
    ] = 1,
    state: Annotated[
        str,
        typer.Option(
            help="What the person does where nothing is said: rest, reading, screen, speaking or listening."
        ),
    ] = "listening",
    duration: Annotated[
        float | None, typer.Option(help="Length in seconds. Default: the recording's length.")
    ] = None,
    speaker: Annotated[
        str | None, typer.Option(help="Speaker whose eyes these are, for subtitles with voices (<v Name>).")
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Blinks per minute in --state. Default: the published mean.")
    ] = None,
    blinks_at: Annotated[
        Path | None,
        typer.Option(help="CSV of the times (time_s) at which blinks begin: no others come."),
    ] = None,
    complete: Annotated[
        float | None,
        typer.Option(help="Share of blinks that close the eye completely. Default: 0.286."),
    ] = None,
    lively: Annotated[
        float | None, typer.Option(help="From 0 (calm: half as many blinks) to 1 (lively: twice as many).")
    ] = None,
    gaze: Annotated[
        Path | None,
        typer.Option(
            help=(
                "CSV of the gaze (time_s, right_deg, up_deg): lids follow it, large shifts bring blinks, and "
                "csv, json and arkit write it, too."
            )
        ),
    ] = None,
    blink_while_down: Annotated[
        Path | None,
        typer.Option(
            help=(
                "CSV of a flag (time_s, flag: 0 down, 1 up; or start_s, end_s of when it is up): blinks come "
                "while it is down, and the eyes stay open while it is up."
            )
        ),
    ] = None,
    target: Annotated[str, typer.Option(help="Object (Blender) or node (Maya) with the shapes.")] = "",
    left: Annotated[str, typer.Option(help="Name of the left eye's shape or attribute.")] = "eyeBlinkLeft",
    right: Annotated[str, typer.Option(help="Name of the right eye's shape or attribute.")] = "eyeBlinkRight",
) -> None:
    """Generate the blinks of a performance, timed by pauses and turns of speech.

    Examples:

      stimuli performance speech.wav --out blinks.py --format blender --fps 24

      stimuli performance dialogue.vtt --speaker Anna --out anna.csv --format arkit

      stimuli performance --duration 60 --state reading --out reading.json --format json

      stimuli performance --duration 20 --blinks-at onsets.csv --complete 1 --out given.csv

      stimuli performance --duration 20 --gaze gaze.csv --format arkit --out looks.csv

      stimuli performance --duration 20 --blink-while-down flag.csv --out held.csv

      stimuli performance speech.wav --lively 0.8 --fps 25 --format liveportrait --out eyes.csv
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
            blinks_at,
            complete,
            lively,
            gaze,
            blink_while_down,
            CurveTarget(target, left, right),
        )
    )
