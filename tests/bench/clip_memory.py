"""Memory of one process that renders clips of both characters in turn: the most a build's worker ever holds.

Run: python tests/bench/clip_memory.py 1920x720
"""

import resource
import sys
from dataclasses import replace

from experiments.load import load_experiment
from stimuli_builder.clips.cli_clip import parse_size
from stimuli_builder.clips.design_clips import Options, planned_clips
from stimuli_builder.clips.jobs import render

# Every so manyth clip: one of each character of Exp 1, and of Exp 3 one of each way the lower lid moves.
STEPS = {"exp1": 160, "exp3": 20}


def main() -> None:
    size = parse_size(sys.argv[1] if len(sys.argv) > 1 else "960x360")
    jobs = [
        clip.job
        for name, step in STEPS.items()
        for clip in planned_clips(load_experiment(name), Options())[::step]
    ]
    for job in jobs:
        render(replace(job, look=replace(job.look, size_px=size)))
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    sys.stdout.write(f"{size[0]} x {size[1]} px, {len(jobs)} clips: {peak_gb:.2f} GB at most (must 1.5)\n")


if __name__ == "__main__":
    main()
