"""`stimuli strips`: the pictures that the dashboard's blinks page plays."""

from pathlib import Path
from typing import Annotated

import typer

STRIPS_HELP = """
Write the shipped characters at 33 closures as picture strips, for the dashboard's blinks page.

`make run` does this; after a character was baked anew, `make run` or this command brings them up to date.

Examples:

  stimuli strips --out data/stimuli/strips
"""


def strips_command(
    out: Annotated[Path, typer.Option(help="Folder for the pictures and strips.json; made if not there.")],
) -> None:
    """Write one WebP a character, and strips.json."""
    from stimuli_builder.clips.strips import write_strips

    for name, size in write_strips(out):
        print(f"{out / name}.webp: {size / 1024:.0f} KiB")
