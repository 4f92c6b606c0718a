"""`stimuli model`: fit the PCA blink model, sample new blinks, export animation curves."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.command_line import command_group

MODEL_HELP = """
The PCA blink model: learn from recorded blinks, make new ones, hand curves to animation programs.

Examples:

  stimuli model fit --plot model.png

  stimuli model fit blinks.profiles.csv --out model.json

  stimuli model sample --count 20 --duration 9 --seed 1 --out new.csv

  stimuli model export --format blender --fps 30 --seed 1 --out blink.py
"""

ModelOption = Annotated[
    Path | None, typer.Option(help="Model (JSON) that `stimuli model fit` wrote; the shipped one without it.")
]


PcaOption = Annotated[
    bool,
    typer.Option(
        "--pca", help="Draw from the components of the PCA model, as the paper does and Exp 1-3 are built."
    ),
]


def register(app: typer.Typer) -> None:
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
        typer.Argument(
            help="Tables of profiles that `stimuli blinks` wrote; the shipped library without any."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Model to write (JSON).")] = None,
    components: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Principal components to keep; where not given 5, or one fewer than there are profiles.",
            show_default=False,
        ),
    ] = None,
    eyes: Annotated[
        str,
        typer.Option(
            help="'each': every eye's blink by itself; 'both': left and right together, asymmetry kept; "
            "'auto': both for a table with three or more blinks seen in both eyes."
        ),
    ] = "auto",
    plot: Annotated[Path | None, typer.Option(help="Figure of the model (PNG, SVG, PDF).")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the new blinks in the figure.", min=0)] = 1,
) -> None:
    """Fit the model to recorded profiles and tell how much of their variance it keeps.

    Example: stimuli model fit blinks.profiles.csv --out model.json --plot model.png
    """
    from stimuli_builder.blinks.model_run import fit_model

    fit_model(profiles or [], out, components, eyes, plot, seed)


def sample(
    out: Annotated[Path, typer.Option(help="Table of profiles to write (CSV).")],
    count: Annotated[int, typer.Option(help="How many blinks.", min=1, max=100_000)] = 10,
    duration: Annotated[
        float | None, typer.Option(help="Length of each blink in frames at 30 fps; as drawn without it.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed: the same seed gives the same blinks.", min=0)] = 1,
    full_closure: Annotated[bool, typer.Option("--full-closure", help="Stretch each to closure 1.")] = False,
    model: ModelOption = None,
    pca: PcaOption = False,
    plot: Annotated[Path | None, typer.Option(help="The new blinks as a figure.")] = None,
) -> None:
    """Make new blinks that close as recorded ones do, or by the PCA model (--pca, --model).

    Example: stimuli model sample --count 20 --duration 9 --seed 1 --out new.csv
    """
    from stimuli_builder.blinks.model_run import sample_blinks

    sample_blinks(out, count, duration, seed, model, plot, full_closure=full_closure, pca=pca)


def textbook(
    out: Annotated[Path, typer.Option(help="Table of profiles to write (CSV).")],
    duration: Annotated[float, typer.Option(help="Length in frames at 30 fps.")] = 9.0,
    plot: Annotated[Path | None, typer.Option(help="Figure: the four curves beside a model blink.")] = None,
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
            "--format", help="csv, json, blender (a script), maya (.anim), arkit (CSV), gltf or usd (.usda)."
        ),
    ] = "csv",
    fps: Annotated[
        float | None, typer.Option(help="Frame rate of the curve; 300 for csv and json, else 30, without it.")
    ] = None,
    count: Annotated[
        int, typer.Option(help="Blinks from the model, at natural intervals.", min=1, max=10_000)
    ] = 1,
    duration: Annotated[float | None, typer.Option(help="Length of each in frames at 30 fps.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of blinks and intervals.", min=0)] = 1,
    profile: Annotated[
        list[str] | None,
        typer.Option(help="A shipped profile instead of the model's, by name; repeat for more."),
    ] = None,
    profiles: Annotated[
        Path | None, typer.Option(help="All profiles of a table instead of the model's.")
    ] = None,
    model: ModelOption = None,
    pca: PcaOption = False,
    full_closure: Annotated[bool, typer.Option("--full-closure", help="Stretch each to closure 1.")] = False,
    lead_s: Annotated[float, typer.Option(help="Seconds open before the first and after the last.")] = 0.0,
    target: Annotated[str, typer.Option(help="Object (Blender) or node (Maya) that has the shapes.")] = "",
    left: Annotated[str, typer.Option(help="Name of the left eye's shape or attribute.")] = "eyeBlinkLeft",
    right: Annotated[str, typer.Option(help="Name of the right eye's.")] = "eyeBlinkRight",
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
