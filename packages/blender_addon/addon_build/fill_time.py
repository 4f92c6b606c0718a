"""How long the Blender add-on takes to fill ten minutes at 60 frames a second, in Blender itself.

Run: python -m addon_build.fill_time (needs bpy in .venv-bake); part of `make bench`.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from addon_build.addon import ROOT, build

BLENDER_PYTHON = ROOT / ".venv-bake" / "bin" / "python"
IN_BLENDER = Path(__file__).resolve().parents[1] / "tests" / "in_blender.py"


def main() -> None:
    if not BLENDER_PYTHON.is_file():
        sys.stdout.write("add-on: not measured, Blender as a module (bpy) is not installed in .venv-bake\n")
        return
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        command = [BLENDER_PYTHON, IN_BLENDER, build(folder), folder]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)
    line = next(line for line in ran.stdout.splitlines() if line.startswith("RESULT"))
    used = json.loads(line.removeprefix("RESULT "))
    sys.stdout.write(
        f"add-on: 36,000 frames, {used['keys']} keys per eye, filled in {used['fill_s']:.3f} s of processor "
        f"time (must 1 s), {used['fill_s'] / used['baseline_s']:.2f} times 1,000 single keys\n"
    )


if __name__ == "__main__":
    main()
