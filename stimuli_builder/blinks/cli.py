"""The commands `stimuli blinks`, `stimuli model` and `stimuli profiles`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.command_groups import command_group
from experiments.errors import InputError
from experiments.files import check_folder

if TYPE_CHECKING:
    from stimuli_builder.blinks.labelling import LabelOptions


# `stimuli blinks`: label the blinks of a series or track.

CLASSIFIER = "classifier"
EXAMPLES = """
Detect and measure the blinks in a series (eye aspect ratio or distance) or a track.

The series is a CSV with a column of distances. A track's distance columns are found automatically. Left and
right are sides of the picture: left is the person's right eye, unless the picture is mirrored. Columns of
closure (eyeBlinkLeft, AU45_r) are inverted. Blinks, squints, gaze shifts and closed eyes are distinguished at
15 to 1,000 frames per second. BLINKS.csv has one row per blink. The blinks' profiles (closure at 300 fps) and
a table of all events are written to the same folder. --preset selects the paper's rule instead; its frame
counts refer to 300 fps and are scaled.

Examples:

  stimuli blinks series.csv --column EAR_l --fps 240 --out blinks.csv

  stimuli blinks series.csv --column EAR_l --column EAR_r --fps 240 --out blinks.csv --summary summary.json

  stimuli blinks track.csv --out blinks.csv --plot series.png --plot-aligned aligned.png

  stimuli blinks track.csv --out blinks.csv --report report.html --lids lids.csv --scale inter-ocular

  stimuli blinks track.csv --out blinks.csv --curve take.usda --curve-format usd

  stimuli blinks track.csv --out blinks.csv --review review.csv --reject "left_distance_px:3=talking"
"""


def _register_blinks(app: typer.Typer) -> None:
    """Add `stimuli blinks` to `app`."""
    app.command("blinks", help=EXAMPLES)(blinks)


def blinks(
    series: Annotated[Path, typer.Argument(help="Series or track CSV.")],
    out: Annotated[Path, typer.Option(help="Blinks table to write (CSV).")],
    column: Annotated[list[str] | None, typer.Option(help="Column to use; repeat for both eyes.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frame rate. Default: from the column time_s.")] = None,
    profiles: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Profiles table to write (empty if there is no blink). Default: OUT with the ending "
                ".profiles.csv."
            )
        ),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(
            help=(
                "How blinks are detected: 'classifier' (any rate), or the paper's rule with rest as a "
                "fraction of the peak 'velocity', of the opening ('relative'), or as 0.1 px per frame "
                "('paper')."
            )
        ),
    ] = "classifier",
    gradient_peak: Annotated[
        float | None, typer.Option(help="Gradient at rest, as a fraction of the phase's maximum.")
    ] = None,
    gradient: Annotated[
        float | None,
        typer.Option(help="Gradient at rest, as a fraction of the opening per frame at 300 fps."),
    ] = None,
    gradient_px: Annotated[
        float | None, typer.Option(help="Gradient at rest in px per frame at 300 fps.")
    ] = None,
    opening_px: Annotated[
        float | None,
        typer.Option(help="Opening in px that --gradient-px assumes for a series that is not in px."),
    ] = None,
    minimum_depth: Annotated[
        float | None,
        typer.Option(help="Minimum depth of a blink, as a fraction of the opening. Default: 0.23."),
    ] = None,
    closed: Annotated[
        float | None,
        typer.Option(
            help=(
                "Distance at lid contact. Default: from the deepest blinks. Required for --curve and --lids "
                "if an eye has no blink."
            )
        ),
    ] = None,
    complete_from: Annotated[float, typer.Option(help="Minimum closure of a complete blink.")] = 0.95,
    allow_gaps: Annotated[
        bool | None,
        typer.Option(
            "--allow-gaps/--no-gaps", help="Allow long gaps in a series (always allowed in a track)."
        ),
    ] = None,
    events: Annotated[
        Path | None,
        typer.Option(help="Table of all lid events. Default: OUT with the ending .events.csv."),
    ] = None,
    resample: Annotated[
        bool,
        typer.Option("--resample", help="Resample uneven times to a constant rate first; gaps stay missing."),
    ] = False,
    inverted: Annotated[
        bool | None,
        typer.Option(
            "--inverted/--not-inverted",
            help="Whether high values mean closed (closures, blendshapes). Default: from the column's name.",
        ),
    ] = None,
    summary: Annotated[Path | None, typer.Option(help="Summary to write (JSON).")] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Report to write (HTML): rates, phases, speeds, both eyes, quality, curves."),
    ] = None,
    lids: Annotated[
        Path | None, typer.Option(help="Closure of every frame (CSV); with --scale also mm and degrees.")
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option(
            help=(
                "mm per pixel (from a card in the picture), 'inter-ocular' (60 mm), 'eye-width' (28.2 mm) "
                "or 'iris:I.csv' (11.7 mm, from a table of 'stimuli iris')."
            )
        ),
    ] = None,
    curve: Annotated[
        Path | None, typer.Option(help="The recording as an animation curve, including downward gaze.")
    ] = None,
    curve_format: Annotated[
        str, typer.Option(help="Format of --curve, as for 'stimuli model export --format'.")
    ] = "csv",
    plot: Annotated[
        Path | None, typer.Option(help="Figure of the series with its blinks (PNG, SVG, PDF).")
    ] = None,
    plot_aligned: Annotated[
        Path | None, typer.Option(help="Figure of aligned blinks and histograms.")
    ] = None,
    review: Annotated[Path | None, typer.Option(help="Review file (CSV): each decision adds a row.")] = None,
    reject: Annotated[
        list[str] | None, typer.Option(help="N=reason or COLUMN:N=reason; needs --review.")
    ] = None,
    accept: Annotated[list[str] | None, typer.Option(help="N, N=reason or COLUMN:N; needs --review.")] = None,
) -> None:
    """Label, measure, review, write."""
    from stimuli_builder.blinks.run import BlinksJob, MoreOutputs, run_blinks

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

    from stimuli_builder.blinks.labelling import preset

    given = [limit for limit in (peak, opening, px) if limit is not None]
    if name == CLASSIFIER:
        if given or opening_px is not None or minimum_depth is not None:
            raise InputError(
                "the --gradient options, --opening-px and --minimum-depth need the paper's rule: add "
                "--preset velocity, relative or paper"
            )
        return preset("velocity")
    if len(given) > 1:
        raise InputError("use only one of --gradient-peak, --gradient and --gradient-px")
    options = preset(name)
    if given:
        options = replace(options, gradient_peak=peak, gradient_opening=opening, gradient_px=px)
    if opening_px is not None:
        options = replace(options, opening_px=opening_px)
    return options if minimum_depth is None else replace(options, minimum_depth=minimum_depth)


# `stimuli model`: fit the PCA blink model, sample new blinks, export animation curves.

MODEL_HELP = """
The PCA blink model: learn from recorded blinks, generate new ones, export curves for animation.

Examples:

  stimuli model fit --plot model.png

  stimuli model fit blinks.profiles.csv --out model.json

  stimuli model sample --count 20 --duration 9 --seed 1 --out new.csv

  stimuli model export --format blender --fps 30 --seed 1 --out blink.py
"""

ModelOption = Annotated[
    Path | None, typer.Option(help="Model (JSON) from `stimuli model fit`. Default: the shipped model.")
]


PcaOption = Annotated[
    bool,
    typer.Option("--pca", help="Sample the components of the PCA model, as in the paper and Exp 1-3."),
]


def _register_model(app: typer.Typer) -> None:
    """Add `stimuli model` to `app`."""
    model = command_group(MODEL_HELP)
    model.command("fit")(fit)
    model.command("sample")(sample)
    model.command("textbook")(textbook)
    model.command("export")(export)
    app.add_typer(model, name="model")


def fit(
    profiles: Annotated[
        list[Path] | None,
        typer.Argument(help="Tables of profiles from `stimuli blinks`. Default: the shipped library."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Model to write (JSON).")] = None,
    components: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Principal components to keep. Default: 5, or one fewer than there are profiles.",
            show_default=False,
        ),
    ] = None,
    eyes: Annotated[
        str,
        typer.Option(
            help=(
                "'each': each eye separately; 'both': left and right together, keeping asymmetry; 'auto': "
                "'both' if the table has at least three blinks of both eyes."
            )
        ),
    ] = "auto",
    plot: Annotated[Path | None, typer.Option(help="Figure of the model (PNG, SVG, PDF).")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the new blinks in the figure.", min=0)] = 1,
) -> None:
    """Fit the model to recorded profiles and print how much of their variance it explains.

    Example: stimuli model fit blinks.profiles.csv --out model.json --plot model.png
    """
    from stimuli_builder.blinks.model_run import fit_model

    fit_model(profiles or [], out, components, eyes, plot, seed)


def sample(
    out: Annotated[Path, typer.Option(help="Table of profiles to write (CSV).")],
    count: Annotated[int, typer.Option(help="How many blinks.", min=1, max=100_000)] = 10,
    duration: Annotated[
        float | None, typer.Option(help="Length of each blink in frames at 30 fps. Default: as sampled.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Random seed; the same seed gives the same blinks.", min=0)] = 1,
    full_closure: Annotated[
        bool, typer.Option("--full-closure", help="Stretch each blink to closure 1.")
    ] = False,
    model: ModelOption = None,
    pca: PcaOption = False,
    plot: Annotated[Path | None, typer.Option(help="Figure of the new blinks.")] = None,
) -> None:
    """Make new blinks that move like recorded ones, or sample the PCA model (--pca, --model).

    Example: stimuli model sample --count 20 --duration 9 --seed 1 --out new.csv
    """
    from stimuli_builder.blinks.model_run import sample_blinks

    sample_blinks(out, count, duration, seed, model, plot, full_closure=full_closure, pca=pca)


def textbook(
    out: Annotated[Path, typer.Option(help="Table of profiles to write (CSV).")],
    duration: Annotated[float, typer.Option(help="Length in frames at 30 fps.")] = 9.0,
    plot: Annotated[Path | None, typer.Option(help="Figure of the four curves and a model blink.")] = None,
) -> None:
    """Write the four textbook curves of one length: linear and ease-in/ease-out, symmetric and asymmetric.

    Example: stimuli model textbook --duration 12 --out textbook.csv
    """
    from stimuli_builder.blinks.model_run import textbook_blinks

    textbook_blinks(out, duration, plot)


def export(
    out: Annotated[Path, typer.Option(help="File to write.")],
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            help="csv, json, blender (a script), maya (.anim), arkit, gltf, usd, liveportrait or ditto.",
        ),
    ] = "csv",
    fps: Annotated[
        float | None,
        typer.Option(help="Frame rate of the curve. Default: 300 for csv and json, otherwise 30."),
    ] = None,
    count: Annotated[
        int, typer.Option(help="Blinks from the model, at natural intervals.", min=1, max=10_000)
    ] = 1,
    duration: Annotated[float | None, typer.Option(help="Length of each blink in frames at 30 fps.")] = None,
    seed: Annotated[int, typer.Option(help="Random seed of blinks and intervals.", min=0)] = 1,
    profile: Annotated[
        list[str] | None,
        typer.Option(help="Name of a shipped profile to use instead of the model; repeatable."),
    ] = None,
    profiles: Annotated[
        Path | None, typer.Option(help="CSV of profiles: use all of them instead of the model's.")
    ] = None,
    model: ModelOption = None,
    pca: PcaOption = False,
    full_closure: Annotated[
        bool, typer.Option("--full-closure", help="Stretch each blink to closure 1.")
    ] = False,
    lead_s: Annotated[
        float, typer.Option(help="Seconds with open eyes before the first blink and after the last.")
    ] = 0.0,
    target: Annotated[str, typer.Option(help="Object (Blender) or node (Maya) with the shapes.")] = "",
    left: Annotated[str, typer.Option(help="Name of the left eye's shape or attribute.")] = "eyeBlinkLeft",
    right: Annotated[str, typer.Option(help="Name of the right eye's shape or attribute.")] = "eyeBlinkRight",
) -> None:
    """Export blinks as an animation curve: from the model, from the library, or from a table of profiles.

    Example: stimuli model export --format blender --fps 30 --seed 1 --out blink.py
    """
    from stimuli_builder.blinks.model_run import ExportJob, export_curve

    export_curve(
        ExportJob(
            out=out,
            format_name=format_name,
            fps=fps,
            count=count,
            duration=duration,
            seed=seed,
            profile_names=tuple(profile or ()),
            profiles=profiles,
            model=model,
            pca=pca,
            full_closure=full_closure,
            lead_s=lead_s,
            target=target,
            left=left,
            right=right,
        )
    )


# `stimuli profiles`: the shipped library of blink profiles, and how it is measured again.

LIBRARY_HELP = """
The blink profiles that ship with the project.

Examples:

  stimuli profiles list

  stimuli profiles plot library.png

  stimuli profiles build --data ../shared/data/blink_series --out library/
"""


def _register_profiles(app: typer.Typer) -> None:
    """Add `stimuli profiles` to `app`."""
    profiles = command_group(LIBRARY_HELP, no_args_is_help=False)
    profiles.callback(invoke_without_command=True)(_list_by_default)
    profiles.command("list")(list_profiles)
    profiles.command("plot")(plot_profiles)
    profiles.command("build")(build_library)
    app.add_typer(profiles, name="profiles")


def _list_by_default(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        list_profiles()


def list_profiles() -> None:
    """List the shipped profiles.

    Example: stimuli profiles list
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from stimuli_builder.blinks.library import load_library

    shipped = load_library()
    table = Table("profile", "eye", "down", "up", "at 30 fps", "closure", "recording", box=SIMPLE_HEAD)
    for profile in shipped:
        lengths = [str(profile.down_frames), str(profile.up_frames), f"{profile.duration_frames_30fps:.1f}"]
        closure = f"{profile.closure.max():.2f}"
        table.add_row(profile.profile_id, profile.eye or "", *lengths, closure, profile.recording)
    console = Console(markup=False)
    console.print(table)
    pairs = len(load_library(paired=True))
    console.print(
        f"{len(shipped)} eye profiles; {pairs} blinks seen in both eyes; phases in frames at 300 fps"
    )


def plot_profiles(
    figure: Annotated[Path, typer.Argument(help="Figure to write (PNG, SVG, PDF).")],
) -> None:
    """Draw the library: aligned blinks with their mean, durations, amplitudes; one row per recording.

    Example: stimuli profiles plot library.png
    """
    from stimuli_builder.blinks.library import load_library
    from stimuli_builder.blinks.plots import aligned_figure, save_figure

    shipped = load_library()
    names = dict.fromkeys(profile.recording for profile in shipped)
    save_figure(aligned_figure({name: [p for p in shipped if p.recording == name] for name in names}), figure)
    typer.echo(f"wrote {figure}")


def build_library(
    data: Annotated[Path, typer.Option(help="Folder with the recordings' series.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write. Default: the shipped library's folder.")
    ] = None,
    recordings: Annotated[
        Path | None, typer.Option(help="List of recordings (TOML). Default: the shipped list.")
    ] = None,
    components: Annotated[int, typer.Option(help="Components of the model.")] = 5,
) -> None:
    """Measure the library again: profiles.csv, closures.csv and the fitted model, model.json.

    Example: stimuli profiles build --data recordings --out library
    """
    from stimuli_builder.blinks.library import LIBRARY_FOLDER, RECORDINGS_FILE, read_recordings
    from stimuli_builder.blinks.library.build import recorded_profiles, write_model, write_profiles

    folder = out or LIBRARY_FOLDER
    check_folder(folder)
    entries = read_recordings(recordings or RECORDINGS_FILE)
    measured = [profile for entry in entries for profile in recorded_profiles(entry, data)]
    write_profiles(folder, measured, entries)
    model = write_model(folder, measured, components)
    eye = sum(profile.closure_other is None for profile in measured)
    typer.echo(
        f"{eye} eye profiles and {len(measured) - eye} pairs from {len(entries)} recordings -> {folder}"
    )
    typer.echo(f"model: {components} components explain {model.variance_kept:.1%} of the variance")


# The command groups of blinks: `stimuli blinks`, `stimuli model` and `stimuli profiles`.


def register(app: typer.Typer) -> None:
    """Add the three groups to `stimuli`."""
    _register_blinks(app)
    _register_profiles(app)
    _register_model(app)
