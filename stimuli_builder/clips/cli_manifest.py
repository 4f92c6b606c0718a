"""`stimuli manifest`: the manifest of clips that were not made here."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError

MANIFEST_HELP = """
Write manifest.json for a folder of clips of your own, so that a server can take them.

Levels are read from file names by a pattern, or from a CSV table (column `file`, then one a factor;
`exemplar` numbers the clips of a cell). With the declaration the clips are compared with its design.

Examples:

  stimuli manifest clips/ --pattern '{speed}_{style}_{exemplar}.mp4'

  stimuli manifest clips/ --table levels.csv --experiment my_study.toml
"""


def manifest_command(
    folder: Annotated[Path, typer.Argument(help="Folder of MP4 files.", show_default=False)],
    pattern: Annotated[str | None, typer.Option(help="Names of factors in braces, as in file names.")] = None,
    table: Annotated[Path | None, typer.Option(help="CSV with the levels of each file.")] = None,
    experiment: Annotated[
        str | None, typer.Option(help="TOML file (or exp1 ...) that declares the study.")
    ] = None,
) -> None:
    """Write the manifest of somebody's own clips."""
    from experiments.load import load_experiment
    from experiments.own_clips import levels_from_names, levels_from_table
    from stimuli_builder.clips.own_manifest import film_names, write_own_manifest

    if (pattern is None) == (table is None):
        raise InputError("expected either --pattern or --table, to know which levels each clip has")
    names = film_names(folder)
    if pattern is not None:
        placed = levels_from_names(pattern, names)
    elif table is not None:
        if not table.is_file():
            raise InputError(f"no file {table}; expected a CSV with a column 'file' and one a factor")
        placed = levels_from_table(table.read_text(encoding="utf-8-sig"), names)
    declared = load_experiment(experiment) if experiment else None
    manifest = write_own_manifest(folder, placed, declared)
    cells = len({clip.cell for clip in manifest.clips})
    print(f"{len(manifest.clips)} clips in {cells} cells; wrote {folder / 'manifest.json'}")
