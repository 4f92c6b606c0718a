"""`make bench`: every bench in turn. One that fails or takes too long is named at the end, the others go on.

`BENCH="labels server" make bench` runs those whose name holds one of these words. FACEKIT is the file of the
face model, BLINK_SERIES a folder of recorded series; benches that need them are left out without them.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

FOLDER = Path("bench")
LONGEST_S = 2 * 3600
PYTEST = [
    "-m", "pytest", str(FOLDER), "-o", "python_files=bench_*.py", "--benchmark-only",
    "--benchmark-columns=min,median,rounds", "-s",
]  # fmt: skip
SCRIPTS = (
    "tracking actor", "rendering memory 960x360", "rendering memory 1920x720", "rendering performance",
    "against_r speed", "experimenter", "study_creation", "before_and_after", "evidence_cost",
    "rendering workers", "bench_blinks", "lid_events compare", "stated_error", "recordings label-free",
    "recordings label-error", "track_speed", "recordings reflections",
)  # fmt: skip


def bench_commands() -> dict[str, list[str]]:
    """The arguments of Python for each bench, by name."""
    series, kit = os.environ.get("BLINK_SERIES", ""), os.environ.get("FACEKIT", "")
    scripts = [f"{name} {series}".strip() if name == "lid_events compare" else name for name in SCRIPTS]
    if kit:
        scripts += [f"rendered_tracks {kit}", f"face_quality compare cedar@4 {kit}"]
    commands = {"timings": PYTEST}
    for script in scripts:
        name, *arguments = script.split()
        commands[script] = ["-m", f"{FOLDER}.{name}", *arguments]
    commands["addon_fill"] = ["-m", "addon_build.fill_time"]
    return commands


def run_benches(commands: dict[str, list[str]], longest_s: float = LONGEST_S) -> dict[str, str]:
    """Run the benches; what went wrong with each that failed, by name."""
    failed: dict[str, str] = {}
    for name, arguments in commands.items():
        began = time.monotonic()
        print(f"\n== {name}", flush=True)
        try:
            code = subprocess.run([sys.executable, *arguments], timeout=longest_s, check=False).returncode
        except subprocess.TimeoutExpired:
            failed[name] = f"stopped after {longest_s / 60:.0f} minutes"
            continue
        print(f"== {name}: {time.monotonic() - began:.0f} s", flush=True)
        if code:
            failed[name] = f"exit code {code}"
    return failed


def main(words: list[str]) -> int:
    """Run all benches, or those whose names hold one of the words; 1 where one failed."""
    commands = {
        name: arguments
        for name, arguments in bench_commands().items()
        if not words or any(word in name for word in words)
    }
    failed = run_benches(commands)
    for name, why in failed.items():
        print(f"failed: {name} ({why})", file=sys.stderr)
    print(f"{len(commands) - len(failed)} of {len(commands)} benches completed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
