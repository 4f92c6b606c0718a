"""`make load`: real servers under load and under fire; prints a table and stops by itself.

python tools/load.py                          everything, about a quarter of an hour
python tools/load.py --seconds 20 --only sqlite
python tools/load.py --share 0.2              a fifth of the raters, for a small machine

It ends with code 1 where a rating was lost or stored twice, or another target was missed (at --share 1).
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rich.console import Console
from rich.table import Table

from tools.load_clips import clips
from tools.load_measures import Row
from tools.load_otree import peer
from tools.load_scenarios import burst, export, starts, steady, under_fire
from tools.load_snapshots import snapshots

EXPORTED_ROWS, EXPORTED_PER_S = 1_000_000, 60_000
STORED_ROWS = 500_000
"""Before snapshots of them are taken."""
MARKS = {True: "yes", False: "NO", None: ""}


def scenarios(share: float, seconds: float, workers: int) -> dict[str, Callable[[], list[Row]]]:
    """By name; `share` of the raters and rows."""
    begin_at_once = int(1000 * share)
    return {
        "sqlite": lambda: steady("sqlite", int(300 * share), seconds, 1, 40, math.inf),
        "postgres": lambda: steady("postgres", int(1000 * share), seconds, workers, 60, math.inf),
        "starts": lambda: starts("sqlite", int(300 * share), int(300 * share), seconds / 2, 1, 150),
        "snapshots": lambda: snapshots(int(300 * share), seconds, int(STORED_ROWS * share), 150),
        "clips": lambda: clips(seconds / 4, 10),
        "burst": lambda: burst("sqlite", begin_at_once, 1) + burst("postgres", begin_at_once, workers),
        "many": lambda: steady("postgres", int(5000 * share), seconds, workers, math.inf, math.inf),
        "kill": lambda: under_fire(int(200 * share), seconds, workers),
        "otree": lambda: peer(int(300 * share), seconds / 2),
        "export": lambda: export(int(EXPORTED_ROWS * share), EXPORTED_PER_S),
    }


def table(rows: list[Row]) -> Table:
    """For people."""
    made = Table("scenario", "what", "measured", "target", "met", title="make load")
    for row in rows:
        made.add_row(row.scenario, row.what, row.measured, row.target, MARKS[row.met])
    return made


def markdown(rows: list[Row]) -> str:
    """For docs/server.md."""
    lines = ["| scenario | what | measured | target | met |", "|---|---|---|---|---|"]
    lines += [
        f"| {row.scenario} | {row.what} | {row.measured} | {row.target} | {MARKS[row.met]} |" for row in rows
    ]
    return "\n".join(lines) + "\n"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60, help="length of each steady phase (60)")
    parser.add_argument("--share", type=float, default=1, help="share of the raters and rows (1)")
    parser.add_argument("--workers", type=int, default=2, help="server workers on PostgreSQL (2)")
    names = tuple(scenarios(1, 1, 1))
    parser.add_argument("--only", nargs="*", choices=names, default=names, help="some of the scenarios")
    parser.add_argument("--markdown", type=Path, help="write the table to this file, too")
    return parser.parse_args()


def main() -> int:
    asked = arguments()
    # Ended from outside it still stops its servers: SystemExit passes every `finally`.
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(143))
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = hard if hard != resource.RLIM_INFINITY else max(soft, 65536)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    console, rows = Console(width=140), list[Row]()
    load = os.getloadavg()[0]
    console.print(f"{os.cpu_count()} cores, load before: {load:.1f}; the raters run on the same cores")
    for name in asked.only:
        console.print(f"{name} ...")
        rows += scenarios(asked.share, asked.seconds, asked.workers)[name]()
    console.print(table(rows))
    if asked.markdown:
        asked.markdown.write_text(markdown(rows), encoding="utf-8")
    return int(any(row.met is False for row in rows))


if __name__ == "__main__":
    sys.exit(main())
