"""`stimuli blinks`: label the blinks of a series or track."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.errors import InputError

if TYPE_CHECKING:
    from stimuli_builder.blinks.label_options import LabelOptions

CLASSIFIER = "classifier"
EXAMPLES = """
Label the blinks of a series (eye aspect ratio or distance) or of a track, and measure them.

The series is a CSV with a column of distances; a track's distance columns are found by themselves (left and
right are sides of the picture: left is the person's right eye, unless it is mirrored). Columns of
closure (eyeBlinkLeft, AU45_r) are turned round. Blinks,
squints, gaze shifts and closed eyes are told apart at any rate from 15 to 1,000 frames a second.
BLINKS.csv gets a row a blink; the blinks' profiles (closure at 300 fps) and a table of all events are
written beside it. --preset chooses the paper's rule instead; its frame counts are at 300 fps and scale.

Examples:

  stimuli blinks series.csv --column EAR_l --fps 240 --out blinks.csv

  stimuli blinks series.csv --column EAR_l --column EAR_r --fps 240 --out blinks.csv --summary summary.json

  stimuli blinks track.csv --out blinks.csv --plot series.png --plot-aligned aligned.png

  stimuli blinks track.csv --out blinks.csv --report report.html --lids lids.csv --scale inter-ocular

  stimuli blinks track.csv --out blinks.csv --curve take.usda --curve-format usd

  stimuli blinks track.csv --out blinks.csv --review review.csv --reject "left_distance_px:3=talking"
"""


def register(app: typer.Typer) -> None:
    """Add `stimuli blinks` to `app`."""
    app.command("blinks", help=EXAMPLES)(blinks)


def blinks(
    series: Annotated[Path, typer.Argument(help="Series or track CSV.")],
    out: Annotated[Path, typer.Option(help="Blinks table to write (CSV).")],
    column: Annotated[list[str] | None, typer.Option(help="Column to label; repeat for both eyes.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frame rate; from the column time_s without it.")] = None,
    profiles: Annotated[
        Path | None,
        typer.Option(
            help="Profiles table to write (empty without a blink); OUT with the ending .profiles.csv "
            "without it."
        ),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(
            help="How blinks are told: 'classifier' (any rate), or the paper's rule with rest as part of the "
            "peak 'velocity', as part of the opening ('relative'), or 0.1 px a frame ('paper')."
        ),
    ] = "classifier",
    gradient_peak: Annotated[
        float | None, typer.Option(help="Gradient at rest, as part of the phase's greatest.")
    ] = None,
    gradient: Annotated[
        float | None, typer.Option(help="Gradient at rest, as part of the opening per frame at 300 fps.")
    ] = None,
    gradient_px: Annotated[
        float | None, typer.Option(help="Gradient at rest in px per frame at 300 fps.")
    ] = None,
    opening_px: Annotated[
        float | None, typer.Option(help="Opening in px that --gradient-px supposes for a series not in px.")
    ] = None,
    minimum_depth: Annotated[
        float | None, typer.Option(help="Least depth of a blink as part of the opening; 0.23 without it.")
    ] = None,
    closed: Annotated[
        float | None,
        typer.Option(
            help="Distance at lid contact; from the deepest blinks without it. Eyes without a blink need it "
            "for --curve and --lids."
        ),
    ] = None,
    complete_from: Annotated[float, typer.Option(help="Closure from which a blink is complete.")] = 0.95,
    allow_gaps: Annotated[
        bool | None,
        typer.Option(
            "--allow-gaps/--no-gaps", help="Label round long gaps; tracks allow them, plain series not."
        ),
    ] = None,
    events: Annotated[
        Path | None,
        typer.Option(help="Table of all lid events; OUT with the ending .events.csv without it."),
    ] = None,
    resample: Annotated[
        bool, typer.Option("--resample", help="Bring uneven times to an even rate first; holes are not seen.")
    ] = False,
    inverted: Annotated[
        bool | None,
        typer.Option(
            "--inverted/--not-inverted",
            help="Whether high is shut (closures, blendshapes); from the column's name without it.",
        ),
    ] = None,
    summary: Annotated[Path | None, typer.Option(help="Summary to write (JSON).")] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Page to write (HTML): rates, phases, speeds, both eyes, quality, curves."),
    ] = None,
    lids: Annotated[
        Path | None, typer.Option(help="Every frame's closure, and mm and degrees with --scale (CSV).")
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option(
            help="mm in a pixel (of a card in the picture), 'inter-ocular' (60 mm), 'eye-width' (28.2 mm) "
            "or 'iris:I.csv' (11.7 mm, by a table of 'stimuli iris')."
        ),
    ] = None,
    curve: Annotated[
        Path | None, typer.Option(help="The recording itself as an animation curve, looking down included.")
    ] = None,
    curve_format: Annotated[
        str, typer.Option(help="Format of --curve, as of 'stimuli model export --format'.")
    ] = "csv",
    plot: Annotated[
        Path | None, typer.Option(help="The labelled series as a figure (PNG, SVG, PDF).")
    ] = None,
    plot_aligned: Annotated[
        Path | None, typer.Option(help="Aligned blinks and histograms as a figure.")
    ] = None,
    review: Annotated[
        Path | None, typer.Option(help="Review file (CSV), kept up to date with decisions.")
    ] = None,
    reject: Annotated[
        list[str] | None, typer.Option(help="N=reason or COLUMN:N=reason; needs --review.")
    ] = None,
    accept: Annotated[list[str] | None, typer.Option(help="N, N=reason or COLUMN:N; needs --review.")] = None,
) -> None:
    """Label, measure, review, write."""
    from stimuli_builder.blinks.outputs import MoreOutputs
    from stimuli_builder.blinks.run import BlinksJob, run_blinks

    run_blinks(
        BlinksJob(
            series=series,
            out=out,
            columns=tuple(column or ()),
            fps=fps,
            profiles=profiles or out.with_name(f"{out.stem}.profiles.csv"),
            options=_options(preset, gradient_peak, gradient, gradient_px, opening_px, minimum_depth),
            closed=closed,
            complete_from=complete_from,
            allow_gaps=allow_gaps,
            classify=preset == CLASSIFIER,
            events=events or out.with_name(f"{out.stem}.events.csv"),
            resample=resample,
            inverted=inverted,
            more=MoreOutputs(report, lids, scale, curve, curve_format),
            summary=summary,
            plot=plot,
            plot_aligned=plot_aligned,
            review=review,
            reject=tuple(reject or ()),
            accept=tuple(accept or ()),
        )
    )


def _options(
    name: str,
    peak: float | None,
    opening: float | None,
    px: float | None,
    opening_px: float | None,
    minimum_depth: float | None,
) -> "LabelOptions":
    from dataclasses import replace

    from stimuli_builder.blinks.label_options import preset

    given = [limit for limit in (peak, opening, px) if limit is not None]
    if name == CLASSIFIER:
        if given or opening_px is not None or minimum_depth is not None:
            raise InputError(
                "the --gradient options, --opening-px and --minimum-depth belong to the paper's rule: "
                "add --preset velocity, relative or paper"
            )
        return preset("velocity")
    if len(given) > 1:
        raise InputError("give one of --gradient-peak, --gradient and --gradient-px")
    options = preset(name)
    if given:
        options = replace(options, gradient_peak=peak, gradient_opening=opening, gradient_px=px)
    if opening_px is not None:
        options = replace(options, opening_px=opening_px)
    return options if minimum_depth is None else replace(options, minimum_depth=minimum_depth)
