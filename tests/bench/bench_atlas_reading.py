"""Reading a shipped face: memory at the most against what stays, and time against decoding its video alone.

`make bench`, or: python -m pytest tests/bench/bench_atlas_reading.py -o python_files='bench_*.py' -s
"""

import subprocess
import sys

import pytest

from stimuli_builder.characters.atlas import SHIPPED

# In a process of its own: the most that a process ever held does not sink again.
READING = """
import resource, sys, time
import cv2
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.level_video import decode_level_video
from stimuli_builder.clips.characters import find_character
import stimuli_builder.clips.characters

cv2.setNumThreads(1)
name, most = sys.argv[1], lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
before, began = most(), time.process_time()
levels = find_character(name).levels((960, 360))
took, peak = time.process_time() - began, most() - before
kept = levels.base.nbytes + levels.levels.nbytes
with_lower = peak
if levels.read_lower:
    levels.lower
    with_lower = most() - before
content, began = (SHIPPED / name / "levels.mkv").read_bytes(), time.process_time()
decode_level_video(content, "levels", "levels.mkv")
print(took, time.process_time() - began, peak, kept, with_lower)
"""


@pytest.mark.parametrize("name", sorted(file.parent.name for file in SHIPPED.glob("*/levels.mkv")))
def test_reading(name: str) -> None:
    command = [sys.executable, "-c", READING, name]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    took, decoding, peak, kept, with_lower = map(float, out.split())
    sys.stdout.write(
        f"\n{name}: {peak / 1e6:.0f} MB at the most above the libraries, {peak / kept:.2f} of the "
        f"{kept / 1e6:.0f} MB of levels that stay, {with_lower / 1e6:.0f} MB once the lower lid moves; "
        f"{took:.2f} s of processor, {took / decoding:.1f} of its video's decoding\n"
    )
