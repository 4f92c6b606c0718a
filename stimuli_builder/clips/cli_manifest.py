"""`stimuli manifest`: the manifest of clips that were not made here."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError

MANIFEST_HELP = """
Write manifest.json for a folder of clips of your own, so that a server can take them.

Levels are read from file names by a pattern, or from a CSV table (column `file`, then one a factor;
`exemplar` numbers the clips of a cell). With the declaration the clips are compared with its design.
Videos of any usual format are taken. Where each is H.264 that browsers play, the manifest is written
beside them; else all are put into FOLDER/clips (or --out): converted as the server converts uploads, with
frame map and lowest PSNR in the manifest and each original beside its clip.

Examples:

  stimuli manifest clips/ --pattern '{speed}_{style}_{exemplar}.mp4'

  stimuli manifest clips/ --table levels.csv --experiment my_study.toml

  stimuli manifest recordings/ --pattern '{actor}_{mood}.mp4' --out clips/ --fps 30
"""


def manifest_command(
    folder: Annotated[Path, typer.Argument(help="Folder of videos.", show_default=False)],
    pattern: Annotated[str | None, typer.Option(help="Names of factors in braces, as in file names.")] = None,
    table: Annotated[Path | None, typer.Option(help="CSV with the levels of each file.")] = None,
    experiment: Annotated[
        str | None, typer.Option(help="TOML file (or exp1 ...) that declares the study.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for clips and manifest.")] = None,
    fps: Annotated[
        float | None, typer.Option(min=1, max=240, help="Frame rate of every clip; else each its own.")
    ] = None,
) -> None:
    """Write the manifest of somebody's own clips."""
    from experiments.load import load_experiment
    from experiments.own_clips import levels_from_names, levels_from_table
    from experiments.text_tables import whole_text_of
    from stimuli_builder.clips.own_levels import understood
    from stimuli_builder.clips.own_manifest import clip_names, write_own_manifest

    if (pattern is None) == (table is None):
        raise InputError("expected either --pattern or --table, to know which levels each clip has")
    names = clip_names(folder)
    if pattern is not None:
        placed = levels_from_names(pattern, names)
    elif table is not None:
        if not table.is_file():
            raise InputError(f"no file {table}; expected a CSV with a column 'file' and one a factor")
        placed = levels_from_table(whole_text_of(table), names)
    print(*understood(placed, pattern), sep="\n", flush=True)
    declared = load_experiment(experiment) if experiment else None
    with _looking_into(len(placed)) as report:
        manifest, target = write_own_manifest(folder, placed, declared, out, fps, report)
    cells = len({clip.cell for clip in manifest.clips})
    converted = f", {len(manifest.sources)} converted" if manifest.sources else ""
    print(f"{len(manifest.clips)} clips in {cells} cells{converted}; wrote {target / 'manifest.json'}")


@contextmanager
def _looking_into(total: int) -> Iterator[Callable[[int], None]]:
    """A function to report how many are done: a bar on stderr, nothing where that is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("videos", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(
        *columns, console=Console(stderr=True, markup=False), disable=not sys.stderr.isatty()
    ) as progress:
        task = progress.add_task("videos", total=total)
        yield lambda done: progress.update(task, completed=done)
