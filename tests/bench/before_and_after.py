"""What ratings, the start of a run and `analysis run exp3` cost beside an earlier revision, in one run.

    PYTHONPATH=. python tests/bench/before_and_after.py [REVISION, default c84c2e8] [rounds, default 3]

Both revisions run with the packages of this one, in turns, so that load and machine are the same for both.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ONE = Path(__file__).with_name("one_revision.py")


def measured(tree: Path, folder: Path) -> dict[str, float]:
    """One round of one revision."""
    environment = os.environ | {"PYTHONPATH": str(tree), "PALPEBRA_DATA_FOLDER": str(folder / "none")}
    server = tree / "server"
    if (server / "evidence").is_dir() or (server / "participation" / "evidence.py").is_file():
        environment["RECORDS_EVIDENCE"] = "1"  # as tests' participants bring none
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, str(ONE), str(folder)], cwd=tree, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(f"{tree}: {done.stderr[-2000:]}")
    figures: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return figures


def main(revision: str = "c84c2e8", rounds: str = "3") -> None:
    with tempfile.TemporaryDirectory() as temporary:
        old = Path(temporary, "tree")
        subprocess.run(["git", "clone", "-q", "--no-checkout", str(ROOT), str(old)], check=True)
        subprocess.run(["git", "-C", str(old), "checkout", "-q", revision], check=True)
        before, after = [], []
        for number in range(int(rounds)):
            before.append(measured(old, Path(temporary, f"before-{number}")))
            after.append(measured(ROOT, Path(temporary, f"after-{number}")))
    sys.stdout.write(
        f"{'load ' + ' '.join(f'{x:.1f}' for x in os.getloadavg()):<46} {revision:>9} {'here':>9} ratio\n"
    )
    for name in before[0]:
        then = statistics.median(one[name] for one in before)
        now = statistics.median(one[name] for one in after)
        sys.stdout.write(f"{name:<46} {then:>9.2f} {now:>9.2f} {now / then:>5.2f}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
