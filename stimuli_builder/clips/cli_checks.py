"""`stimuli checks`: the clips of a study's motion checks."""

from pathlib import Path
from typing import Annotated

import typer

CHECKS_HELP = """
Make the clips of a study's motion checks, whose content shows in motion alone.

`stimuli build` makes them too; this command adds them to clips of your own, or makes other ones. They come
from a secret seed, kept in manifest.json with the right answers: keep that file from participants. The same
seed gives the same bytes on one machine.

Examples:

  stimuli checks my_study.toml --out clips/mine

  stimuli checks my_study.toml --out clips/mine --anew

  stimuli checks my_study.toml --out clips/mine --seed 20261122
"""


def checks_command(
    experiment: Annotated[
        str, typer.Argument(help="exp1 to exp3, a demo, or a TOML file.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="Folder that holds the study's clips and manifest.json.")],
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed; a secret one is drawn, and kept, where not given.")
    ] = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Make other checks than those that are there.")
    ] = False,
) -> None:
    """Make the clips of motion checks."""
    from experiments.errors import InputError
    from experiments.load import load_experiment
    from stimuli_builder.checks.build import build_checks
    from stimuli_builder.clips.cli import progress_bar
    from stimuli_builder.clips.design_clips import Options
    from stimuli_builder.clips.plan import experiment_folder

    if anew and seed is not None:
        raise InputError("--anew draws a seed; leave out --seed")
    declared = load_experiment(experiment)
    options = Options(checks_seed=seed, beside=experiment_folder(experiment))
    with progress_bar(f"checks of {declared.name}") as progress:
        report = build_checks(declared, out, options, progress, anew=anew)
    size_mb = sum({clip.file: clip.bytes for clip in report.manifest.checks}.values()) / 1e6
    removed = f", {len(report.removed)} old ones removed" if report.removed else ""
    print(
        f"{declared.name}: {len(report.manifest.checks)} clips of checks in {out} ({size_mb:.1f} MB); "
        f"{report.built} made{removed}"
    )
