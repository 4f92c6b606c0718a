"""`stimuli plan`, `build`, `verify`, `checks`, `manifest`, `siti` and `strips`."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.errors import InputError, counted

if TYPE_CHECKING:
    from experiments.level_leaks import LevelLeak
    from stimuli_builder.clips.build import Progress, Report


# `stimuli plan`, `stimuli build` and `stimuli verify`; other commands have separate files.

ExperimentName = Annotated[
    str, typer.Argument(help="exp1 to exp3, a demo, or a TOML file.", show_default=False)
]
PLAN_HELP = """
Print an experiment's design: factors, cells, clips, trials, blocks and expected minutes.

It also lists 'real' exemplars that show a recording for the second time.

The keys of --json: name, title, participants, factors, cells, exemplars_per_cell, unique_clips,
trials_per_participant, practice_trials, blocks, order, expected_minutes, repeated_profiles.

Examples:

  stimuli plan exp1

  stimuli plan my_study.toml --json
"""
BUILD_HELP = """
Build an experiment's clips (H.264 in MP4) and manifest.json.

Only missing or changed clips are rendered. After an interruption, run the same command to continue. The same
seed gives the same bytes on one machine and the same curves on any machine.

Examples:

  stimuli build exp3 --out clips/exp3

  stimuli build my_study.toml --out clips/mine --workers 4 --preview

  stimuli build exp1 --out clips/exp1 --dask tcp://scheduler:8786
"""
VERIFY_HELP = """
Check a folder of clips against its manifest: presence, hashes, frame counts, timing and eyelid opening.

The opening of each eye is measured in the decoded pixels of every frame and compared with its closure curve.
If the character has changed or is not installed, this comparison is skipped.

A warning lists every other feature by which a level can be recognized: where the lids rest at the start and
end, length, picture size, brightness. --levels lists all features.

Examples:

  stimuli verify clips/exp3

  stimuli verify clips/mine --levels
"""


def register(app: typer.Typer) -> None:
    """Add the commands of the clip builder to `app`."""
    from stimuli_builder.clips.cli_clip import CLIP_HELP, clip_command

    app.command("plan", help=PLAN_HELP)(plan_command)
    app.command("build", help=BUILD_HELP)(build_command)
    app.command("checks", help=CHECKS_HELP)(checks_command)
    app.command("clip", help=CLIP_HELP)(clip_command)
    app.command("manifest", help=MANIFEST_HELP)(manifest_command)
    app.command("siti", help=SITI_HELP)(siti_command)
    app.command("strips", help=STRIPS_HELP)(strips_command)
    app.command("verify", help=VERIFY_HELP)(verify_command)


def plan_command(
    experiment: ExperimentName,
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable output.")] = False,
) -> None:
    """Print the design of an experiment."""
    from experiments.load import load_experiment
    from stimuli_builder.clips.plan import print_plan, summary

    plan = summary(load_experiment(experiment))
    if as_json:
        print(json.dumps(plan, indent=2, ensure_ascii=False))
    else:
        print_plan(plan)


def build_command(
    experiment: ExperimentName,
    out: Annotated[Path, typer.Option(help="Folder for the clips; created if missing.")],
    workers: Annotated[
        int | None, typer.Option(min=1, help=("Number of processes. Default: one per core."))
    ] = None,
    dask: Annotated[str | None, typer.Option(help="Address of a Dask scheduler to render on.")] = None,
    seed: Annotated[int | None, typer.Option(help="Random seed instead of the declared one.")] = None,
    preview: Annotated[
        bool, typer.Option("--preview", help="Also write preview.png (contact sheet) and preview.html.")
    ] = False,
    barcode: Annotated[
        bool, typer.Option("--test-barcode", help="Draw each frame's number in its corner, for tests.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet-when-current", help="Print nothing if no clip had to be built.")
    ] = False,
    lines: Annotated[
        bool,
        typer.Option("--progress-lines", help="Print '3 of 80' per clip instead of a bar."),
    ] = False,
) -> None:
    """Build the clips of an experiment."""
    from experiments.load import load_experiment
    from stimuli_builder.clips.build import Machines, build
    from stimuli_builder.clips.design_clips import Options
    from stimuli_builder.clips.plan import experiment_folder

    declared = load_experiment(experiment)
    options = Options(seed=seed, barcode=barcode, base_folder=experiment_folder(experiment))
    with progress_bar(f"building {declared.name}") as bar:
        report = build(declared, out, options, Machines(workers, dask), _print_progress if lines else bar)
    if preview:
        from stimuli_builder.clips.preview import write_preview

        for written in write_preview(report.manifest, out):
            print(f"wrote {written}")
    if not (quiet and report.built == 0):
        _print_report(report, out)


def _print_progress(done: int, total: int) -> None:
    print(f"{done} of {total}", flush=True)


def _print_report(report: "Report", out: Path) -> None:
    clips, manifest = len(report.manifest.clips), report.manifest
    size_mb = sum({clip.file: clip.bytes for clip in manifest.files}.values()) / 1e6
    checks = f" and {len(manifest.checks)} of checks" if manifest.checks else ""
    removed = f", {len(report.removed)} old ones removed" if report.removed else ""
    print(
        f"{manifest.experiment}: {clips} clips{checks} in {out} ({size_mb:.1f} MB); {report.built} built, "
        f"{report.reused} unchanged{removed}"
    )
    for note in manifest.notes:
        if note.startswith("exemplar "):
            print(f"  {note}")


def verify_command(
    folder: Annotated[Path, typer.Argument(help="Folder with manifest.json.", show_default=False)],
    characters: Annotated[Path | None, typer.Option(help="Folder with your own characters.")] = None,
    levels: Annotated[
        bool, typer.Option("--levels", help="Show how well each feature of the clips identifies the levels.")
    ] = False,
) -> None:
    """Check built clips."""
    from stimuli_builder.clips.verify import verify

    with progress_bar("checking") as progress:
        verdict = verify(folder, characters, progress)
    for finding in verdict.findings:
        print(finding)
    if verdict.findings:
        wrong = len({finding.clip.file for finding in verdict.findings})
        again = "run `stimuli manifest` again, which converts clips where necessary"
        raise InputError(
            f"{wrong} of {verdict.clips} clips differ from the manifest; "
            + (again if verdict.is_made_elsewhere else "build them again with `stimuli build`")
        )
    measured = "the opening was not measured in any clip"
    if verdict.opening_checked:
        measured = (
            f"opening measured in {verdict.opening_checked}, "
            f"at most {verdict.worst_opening_mm:.2f} mm from the curve"
        )
    print(f"{verdict.clips} clips: hashes, frames and timing are correct; {measured}")
    if levels:
        _print_leaks(verdict.leaks)
    for leak in verdict.leaks:
        if leak.reported:
            print(f"warning: {leak}", file=sys.stderr)


def _print_leaks(leaks: "Sequence[LevelLeak]") -> None:
    """One line per factor and feature: the share of clips that the feature guesses right, and p."""
    print("factor, feature: proportion of the best level's clips and of the others classified correctly (p)")
    for leak in leaks:
        shown = f"{leak.right:.2f} and {leak.others:.2f}, {leak.clips} clips (p {leak.p_value:.2g})"
        print(f"  {leak.factor}, {leak.feature}: {leak.level} {shown}{' *' if leak.reported else ''}")


@contextmanager
def progress_bar(what: str) -> "Iterator[Progress]":
    """Show clips done and time left on stderr; one line per tenth of them if stderr is not a terminal."""
    if not sys.stderr.isatty():
        yield partial(_print_tenth, what)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(what, markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True, markup=False), transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _print_tenth(what: str, done: int, total: int) -> None:
    """For logs: one line whenever a further tenth of the clips is done, where there are ten or more."""
    if total >= 10 and done and done * 10 // total > (done - 1) * 10 // total:
        print(f"{what}: {done} of {total} clips", file=sys.stderr, flush=True)


# `stimuli checks`: the clips of a study's motion checks.

CHECKS_HELP = """
Generate the clips of a study's motion checks, whose content is visible only in motion.

`stimuli build` also generates them. This command adds them to your own clips, or replaces them. They depend
on a secret seed, stored in manifest.json with the correct answers: do not give that file to participants. The
same seed gives the same bytes on one machine.

Examples:

  stimuli checks my_study.toml --out clips/mine

  stimuli checks my_study.toml --out clips/mine --anew

  stimuli checks my_study.toml --out clips/mine --seed 20261122
"""


def checks_command(
    experiment: Annotated[
        str, typer.Argument(help="exp1 to exp3, a demo, or a TOML file.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="Folder with the study's clips and manifest.json.")],
    seed: Annotated[
        int | None, typer.Option(min=0, help="Random seed. Default: a secret seed is drawn and stored.")
    ] = None,
    anew: Annotated[bool, typer.Option("--anew", help="Replace the existing checks by new ones.")] = False,
) -> None:
    """Make the clips of motion checks."""
    from experiments.load import load_experiment
    from stimuli_builder.checks.plan import build_checks
    from stimuli_builder.clips.design_clips import Options
    from stimuli_builder.clips.plan import experiment_folder

    if anew and seed is not None:
        raise InputError("--anew draws a new seed; remove --seed")
    declared = load_experiment(experiment)
    options = Options(checks_seed=seed, base_folder=experiment_folder(experiment))
    with progress_bar(f"checks of {declared.name}") as progress:
        report = build_checks(declared, out, options, progress, anew=anew)
    size_mb = sum({clip.file: clip.bytes for clip in report.manifest.checks}.values()) / 1e6
    removed = f", {len(report.removed)} old ones removed" if report.removed else ""
    print(
        f"{declared.name}: {counted(len(report.manifest.checks), 'clip')} of checks in {out} "
        f"({size_mb:.1f} MB); {report.built} built{removed}"
    )


# `stimuli manifest`: the manifest of clips that were not made here.

MANIFEST_HELP = """
Write manifest.json for a folder of your own clips, so that a server can use them.

Levels are read from file names with a pattern, or from a CSV table (column `file`, then one per factor;
`exemplar` numbers the clips of a cell). With --experiment, the clips are compared with its design. All common
video formats are accepted. If all videos are H.264 that browsers can play, the manifest is written to their
folder. Otherwise they are converted to FOLDER/clips (or --out), as the server converts uploads. The manifest
then has a frame map and the lowest PSNR, and each original is kept with its clip.

Examples:

  stimuli manifest clips/ --pattern '{speed}_{style}_{exemplar}.mp4'

  stimuli manifest clips/ --table levels.csv --experiment my_study.toml

  stimuli manifest recordings/ --pattern '{actor}_{mood}.mp4' --out clips/ --fps 30
"""


def manifest_command(
    folder: Annotated[Path, typer.Argument(help="Folder of videos.", show_default=False)],
    pattern: Annotated[
        str | None, typer.Option(help=("Pattern of file names, with factor names in braces."))
    ] = None,
    table: Annotated[Path | None, typer.Option(help="CSV with the levels of each file.")] = None,
    experiment: Annotated[
        str | None, typer.Option(help="Declaration of the study: a TOML file, or exp1 to exp3.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for clips and manifest.")] = None,
    fps: Annotated[
        float | None,
        typer.Option(min=1, max=240, help=("Frame rate of all clips. Default: each clip keeps its rate.")),
    ] = None,
) -> None:
    """Write the manifest of somebody's own clips."""
    from experiments.load import load_experiment
    from experiments.own_clips import levels_from_names, levels_from_rows
    from stimuli_builder.clips.own_manifest import clip_names, understood, write_own_manifest
    from table_files.open import named_rows

    if (pattern is None) == (table is None):
        raise InputError("the levels of each clip are unknown: add either --pattern or --table")
    names = clip_names(folder)
    if pattern is not None:
        placed = levels_from_names(pattern, names)
    elif table is not None:
        if not table.is_file():
            raise InputError(
                f"there is no file {table}; expected a CSV with a column 'file' and one column per factor"
            )
        placed = levels_from_rows(named_rows(table), names)
    print(*understood(placed, pattern), sep="\n", flush=True)
    declared = load_experiment(experiment) if experiment else None
    with _looking_into(len(placed)) as report:
        manifest, target = write_own_manifest(folder, placed, declared, out, fps, report)
    cells = counted(len({clip.cell for clip in manifest.clips}), "cell")
    converted = f", {len(manifest.sources)} converted" if manifest.sources else ""
    clips = counted(len(manifest.clips), "clip")
    print(f"{clips} in {cells}{converted}; wrote {target / 'manifest.json'}")


@contextmanager
def _looking_into(total: int) -> Iterator[Callable[[int], None]]:
    """A function to report how many are done: a bar on stderr, nothing if that is not a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("videos", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(
        *columns, console=Console(stderr=True, markup=False), disable=not sys.stderr.isatty()
    ) as progress:
        task = progress.add_task("videos", total=total)
        yield lambda done: progress.update(task, completed=done)


# `stimuli strips`: the pictures that the dashboard's blinks page plays.

SITI_HELP = """
Measure how much detail (SI) and motion (TI) videos have, by ITU-T P.910.

Sources of a quality study should cover a range of both. Values are for 8-bit luminance; the largest value of
all frames counts.

Examples:

  stimuli siti my-clips

  stimuli siti a.mp4 b.mp4 --out siti.csv
"""


def siti_command(
    videos: Annotated[list[Path], typer.Argument(help="Videos, or folders of videos.", show_default=False)],
    out: Annotated[Path | None, typer.Option(help="CSV file to write: file, si, ti.")] = None,
) -> None:
    """Print SI and TI of each video."""
    import csv

    from experiments.files import check_targets, whole_text
    from stimuli_builder.clips.preview import spatial_temporal_information
    from video_conversion.prepared import VIDEO_ENDINGS

    check_targets([out], videos)
    files = [
        file
        for path in videos
        for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        if not path.is_dir() or file.suffix.lower() in VIDEO_ENDINGS
    ]
    if not files:
        raise InputError(f"expected videos, found none in {', '.join(map(str, videos))}")
    with progress_bar("measuring") as report:
        rows = []
        for number, file in enumerate(files, start=1):
            rows.append((file.name, *spatial_temporal_information(file)))
            report(number, len(files))
    width = max(len(name) for name, *_ in rows)
    print(f"{'file':<{width}}     SI     TI")
    for name, si, ti in rows:
        print(f"{name:<{width}}  {si:5.1f}  {ti:5.1f}")
    if out is not None:
        with whole_text(out) as stream:
            table = csv.writer(stream, lineterminator="\n")
            table.writerow(("file", "si", "ti"))
            table.writerows((name, f"{si:.3f}", f"{ti:.3f}") for name, si, ti in rows)
        print(f"written: {out}")


STRIPS_HELP = """
Write picture strips of the shipped characters at 33 closures, for the dashboard's blinks page.

`make run` does this. After baking a character again, update them with `make run` or this command.

Examples:

  stimuli strips --out data/stimuli/strips
"""


def strips_command(
    out: Annotated[Path, typer.Option(help="Folder for the pictures and strips.json; created if missing.")],
) -> None:
    """Write one WebP per character, and strips.json."""
    from stimuli_builder.clips.preview import write_strips

    for name, size in write_strips(out):
        print(f"{out / name}.webp: {size / 1024:.0f} KiB")
