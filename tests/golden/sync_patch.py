"""Writes `sync_patch.json`: fields of some frames, for the code that draws them and the code that reads them.

python -m tests.golden.sync_patch
"""

import json
from pathlib import Path

from stimuli_builder.sync_patch.film import fields_of_number

FRAMES = (0, 1, 2, 3, 7, 8, 59, 127, 128, 255, 256, 300)
FILE = Path(__file__).with_name("sync_patch.json")


def drawn() -> dict[str, str]:
    """Nine characters per frame, row by row: 1 for white."""
    return {str(number): "".join(str(int(white)) for white in fields_of_number(number)) for number in FRAMES}


if __name__ == "__main__":
    FILE.write_text(json.dumps(drawn(), indent=1) + "\n", encoding="utf-8")
