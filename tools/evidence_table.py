"""Table of docs/evidence.md: which signal speaks against how many runs of each manner.

server simulate STUDY --as MANNER --participants 20 --json FOLDER/MANNER.json   (for each manner)
python tools/evidence_table.py FOLDER
"""

import json
import sys
from collections import Counter
from pathlib import Path

from server.evidence.signals import SIGNAL_NAMES
from server.evidence.verdict import VERDICTS, points_of
from server.simulation.manners import MANNERS


def main(folder: Path) -> None:
    """Print the table for the files of this folder."""
    runs = {
        name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))["runs"] for name in MANNERS
    }
    rows = [("Runs", {name: str(len(found)) for name, found in runs.items()})]
    rows.append(("Answers refused", {name: str(refused(found)) for name, found in runs.items()}))
    for verdict in VERDICTS[:3]:
        counts = {name: Counter(run["verdict"] for run in found)[verdict] for name, found in runs.items()}
        rows.append((f"Verdict `{verdict}`", {name: str(count) for name, count in counts.items()}))
    for signal in SIGNAL_NAMES:
        against = {
            name: sum(points_of(signal, run["signals"][signal]) < 0 for run in found if run["answers"])
            for name, found in runs.items()
        }
        rows.append((f"`{signal}` against", {name: str(count or "") for name, count in against.items()}))
    lines = ["| | " + " | ".join(MANNERS) + " |", "|---|" + "--:|" * len(MANNERS)]
    lines += [f"| {title} | " + " | ".join(cells[name] for name in MANNERS) + " |" for title, cells in rows]
    sys.stdout.write("\n".join(lines) + "\n")


def refused(runs: list[dict[str, dict[str, int]]]) -> int:
    """Answers refused in all runs."""
    return sum(sum(run["refused"].values()) for run in runs)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
