"""Memory of one process that renders a performance: the same for a clip of 60 s as for one of 5 s.

Run: python tests/bench/performance_memory.py, which prints the peak of each in a process of its own; with a
character and seconds it renders that one.
"""

import resource
import subprocess
import sys

from experiments.declaration.rendering import RenderSettings
from stimuli_builder.clips.design_clips import Options, look_of, performance_curve
from stimuli_builder.clips.jobs import ClipJob, render

LENGTHS_S = (5.0, 60.0)
CHARACTERS = ("cartoon", "alder@8")


def peak_mb(character: str, seconds: float) -> float:
    """Peak resident memory of a new process that renders one clip of 960 x 360 px, in MB."""
    command = [sys.executable, __file__, character, f"{seconds:g}"]
    return float(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


def rendered_mb(character: str, seconds: float) -> float:
    """Render a clip here; this process's peak resident memory, in MB."""
    settings = RenderSettings(character=character, performance="intervals", seconds=seconds)
    curve = performance_curve(settings, "", 1, 2011)
    render(ClipJob(look_of(settings, Options()), curve))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def main() -> None:
    if len(sys.argv) > 2:
        sys.stdout.write(f"{rendered_mb(sys.argv[1], float(sys.argv[2])):.1f}")
        return
    for character in CHARACTERS:
        short, long = (peak_mb(character, seconds) for seconds in LENGTHS_S)
        sys.stdout.write(
            f"{character}: {short:.0f} MB for {LENGTHS_S[0]:g} s, {long:.0f} MB for {LENGTHS_S[1]:g} s, "
            f"ratio {long / short:.3f} (must 1.05)\n"
        )


if __name__ == "__main__":
    main()
