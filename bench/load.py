"""`make load`: real servers under load and under fire; prints a table and stops by itself.

python -m bench.load                          everything, about a quarter of an hour
python -m bench.load --seconds 20 --only sqlite
python -m bench.load --share 0.2              a fifth of the raters, for a small machine

It ends with code 1 where a rating was lost or stored twice, or another target was missed (at --share 1).
"""

from __future__ import annotations

import argparse
import asyncio
import math
import os
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rich.console import Console
from sqlalchemy import text

from bench.clip_load import proxied_clips
from bench.harness import ROOT, Row, console_table, markdown_table, percentile, quantiles
from bench.otree import rated_on_otree
from bench.raters import (
    AT_ONCE_AT_START,
    EVERY_S,
    WORKER_KILLS,
    Tally,
    begin,
    prepare,
    rate,
    rated,
    run,
    saved,
)
from bench.servers import LoadServer, load_server
from server.operations.snapshots import FOLDER, database_file

DATABASE_KILLS = 5
EXPORTED_ROWS, EXPORTED_PER_S = 1_000_000, 60_000
STORED_ROWS = 500_000
"""Before snapshots of them are taken."""
EVERY_MINUTES = 0.4
LOOK_S = 0.02
FILLERS = 20
Window = tuple[float, float]
"""When a snapshot began and ended, on the clock of the raters' answers."""


def steady(kind: str, count: int, seconds: float, workers: int, p95: float, p99: float) -> list[Row]:
    """`count` raters, a clip and a rating each 6 s; `p95` and `p99` are limits in ms, infinite where none."""
    with load_server(kind, workers) as server:
        tally, clocks = rated(server, count, seconds)
        costs = clocks.rows(len(tally.rating_ms))
        all_there = saved(server, tally)
        began = time.monotonic()
        server.stop()
        stopping = time.monotonic() - began
    name = f"{count} raters, {kind}, {workers} worker{'s' * (workers > 1)}, {seconds:.0f} s"
    limits = [f"p{share} < {limit:g}" for share, limit in ((95, p95), (99, p99)) if limit < math.inf]
    quick = percentile(tally.rating_ms, 0.95) < p95 and percentile(tally.rating_ms, 0.99) < p99
    waits, clips = (quantiles(values, 0.5, 0.95, 0.99) for values in (tally.rating_ms, tally.clip_ms))
    started = f"{len(tally.rating_ms)}; {tally.failed_starts}"
    return [
        Row(name, "rating p50 / p95 / p99 (ms)", waits, ", ".join(limits), quick if limits else None),
        Row("", "clip p50 / p95 / p99 (ms)", clips),
        Row("", "ratings; failed starts", started, "failed 0", not tally.failed_starts),
        all_there,
        *costs,
        Row("", "requests sent again; graceful stop (s)", f"{tally.retries}; {stopping:.1f}"),
    ]


def burst(kind: str, count: int, workers: int) -> list[Row]:
    """`count` run starts at the same moment."""
    tally = Tally()
    with load_server(kind, workers) as server:
        began = time.monotonic()

        async def go() -> None:
            await begin(server, count, tally, count)

        run(go())
        took = time.monotonic() - began
        with server.opened.database.read() as session:
            rows = session.execute(
                text(
                    "SELECT study_run_id, version_clip_id, block_label "
                    "FROM assigned_trials JOIN trial_clips USING (study_run_id, trial_index) "
                    "WHERE kind = 'main' ORDER BY study_run_id, trial_index"
                )
            ).all()
    return [
        Row(f"burst of {count} starts, {kind}", "failed", *_shown(tally.failed_starts, 0)),
        *_orders(rows, count),
        Row("", "all begun after (s); p50 / p95 (ms)", f"{took:.1f}; {quantiles(tally.start_ms, 0.5, 0.95)}"),
    ]


def starts(kind: str, count: int, newcomers: int, seconds: float, workers: int, p95: float) -> list[Row]:
    """`count` raters at their pace while `newcomers` begin at the same moment; `p95` is the limit in ms."""
    tally, begun = Tally(), Tally()
    window = [0.0, 0.0]
    with load_server(kind, workers) as server:

        async def go() -> None:
            raters = await begin(server, count, tally, AT_ONCE_AT_START)
            await prepare(raters)
            rating = asyncio.create_task(rate(raters, seconds))
            await asyncio.sleep(seconds / 3)
            window[0] = time.perf_counter()
            await begin(server, newcomers, begun, newcomers)
            window[1] = time.perf_counter()
            await rating

        run(go())
        all_there = saved(server, tally)
    pairs = list(zip(tally.rating_at, tally.rating_ms, strict=True))
    during = [ms for at, ms in pairs if window[0] <= at <= window[1]]
    others = [ms for at, ms in pairs if not window[0] <= at <= window[1]]
    said = f"{window[1] - window[0]:.1f}; {quantiles(begun.start_ms, 0.5, 0.95)}"
    return [
        Row(
            f"{newcomers} starts at once among {count} raters, {kind}",
            f"rating p50 / p95 / p99 meanwhile, of {len(during)} (ms)",
            quantiles(during, 0.5, 0.95, 0.99),
            f"p95 < {p95:g}",
            percentile(during, 0.95) < p95,
        ),
        Row("", "before and after (ms)", quantiles(others, 0.5, 0.95, 0.99)),
        Row("", "failed starts", *_shown(begun.failed_starts, 0)),
        Row("", "all begun after (s); p50 / p95 (ms)", said),
        all_there,
    ]


def _shown(kills: int, needed: int) -> tuple[str, str, bool]:
    return str(kills), str(needed), kills == needed


def _orders(rows: Iterable[Any], count: int) -> list[Row]:
    """Of (run, clip, block's label) in order: whether all orders differ and first blocks are dealt evenly."""
    orders: dict[int, list[int]] = {}
    firsts: Counter[str] = Counter()
    for run_id, clip, label in rows:
        firsts[label] += run_id not in orders
        orders.setdefault(run_id, []).append(clip)
    distinct = len({tuple(order) for order in orders.values()})
    spread = max(firsts.values()) - min(firsts.values()) if len(firsts) > 1 else count
    return [
        Row("", "distinct orders", *_shown(distinct, count)),
        Row("", "first blocks differ by", str(spread), "at most 1", spread <= 1),
    ]


def under_fire(count: int, seconds: float, workers: int) -> list[Row]:
    """kill -9 of server workers and of the whole of PostgreSQL while ratings arrive."""
    tally, kills = Tally(), Counter[str]()
    with load_server("postgres", workers) as server:

        def fire(number: int) -> None:
            kills["worker"] += server.kill_worker(number)
            if number % (WORKER_KILLS // DATABASE_KILLS) == 2:
                server.database.kill()
                kills["PostgreSQL"] += 1

        async def go() -> None:
            raters = await begin(server, count, tally, AT_ONCE_AT_START)
            await prepare(raters)
            await rate(raters, seconds, fire)

        run(go())
        server.opened.database.engine.dispose()
        all_there = saved(server, tally)
    said = ", ".join(f"{number} x {what}" for what, number in kills.items())
    complete = kills == {"worker": WORKER_KILLS, "PostgreSQL": DATABASE_KILLS}
    needed = f"{WORKER_KILLS}, {DATABASE_KILLS}"
    return [
        Row(f"kill -9, {count} raters, postgres, {seconds:.0f} s", "killed", said, needed, complete),
        Row("", "acknowledged; requests sent again", f"{len(tally.acknowledged)}; {tally.retries}"),
        all_there,
    ]


def export(rows: int, target: float) -> list[Row]:
    """The CSV of so many rows: speed, and the memory of the process that writes it."""
    tally = Tally()
    with load_server("sqlite", 1) as server:

        async def go() -> None:
            raters = await begin(server, AT_ONCE_AT_START, tally, AT_ONCE_AT_START)
            await prepare(raters)
            await rate(raters, 2 * EVERY_S)

        run(go())
        multiply(server, rows)
        out = server.settings.data_folder / "out.csv"
        environment = {**os.environ, "DATABASE_URL": server.settings.database_url}
        environment["PALPEBRA_DATA_FOLDER"] = str(server.settings.data_folder)
        command = [sys.executable, "-m", "server", "export", "short", "--out", str(out)]
        began = time.monotonic()
        peak_mb = _peak_mb(subprocess.Popen(command, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL))
        seconds = time.monotonic() - began
        with out.open(encoding="utf-8") as stream:
            written = sum(1 for _ in stream) - 1
    speed, name = written / seconds, f"export of {written} rows to CSV, sqlite"
    return [
        Row(name, "rows/s, program start included", f"{speed:.0f}", f"> {target:.0f}", speed > target),
        Row("", "its largest memory (MB)", f"{peak_mb:.0f}"),
    ]


def _peak_mb(process: subprocess.Popen[bytes]) -> float:
    """Wait for a process; RUSAGE_CHILDREN would give the largest of all that were started before, too."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    return usage.ru_maxrss / 1024


def multiply(server: LoadServer, rows: int) -> None:
    """Copy stored ratings as further plays until there are `rows`."""
    with server.opened.database.write_connection() as connection:
        columns = [row[1] for row in connection.exec_driver_sql("PRAGMA table_info(trial_ratings)")]
        there = connection.exec_driver_sql("SELECT count(*) FROM trial_ratings").scalar_one()
        changed = {"id": "NULL", "rating_id": "rating_id || '-' || n", "play": "play + n", "drawn": "NULL"}
        values = ", ".join(changed.get(column, column) for column in columns)
        connection.exec_driver_sql(
            "WITH RECURSIVE series(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM series "
            f"WHERE n < {rows // there}) "
            f"INSERT INTO trial_ratings ({', '.join(columns)}) SELECT {values} FROM trial_ratings, series"
        )


def snapshots(count: int, seconds: float, stored_rows: int, p95: float) -> list[Row]:
    """`count` raters on a database with so many ratings, of which the server takes snapshots meanwhile."""
    tally, windows = Tally(), list[Window]()
    with load_server("sqlite", 1, snapshot_minutes=str(EVERY_MINUTES)) as server:
        folder = server.settings.data_folder / FOLDER

        async def go() -> None:
            fillers = await begin(server, FILLERS, Tally(), FILLERS)
            await prepare(fillers)
            await rate(fillers, 2 * EVERY_S)
            await asyncio.to_thread(multiply, server, stored_rows)
            raters = await begin(server, count, tally, AT_ONCE_AT_START)
            await prepare(raters)
            watching = asyncio.create_task(_watch(folder, windows))
            await rate(raters, seconds)
            watching.cancel()

        run(go())
        size_mb = database_file(server.settings).stat().st_size / 1e6
        all_there = saved(server, tally)
    during, others = divided(tally, windows)
    took = ", ".join(f"{ended - begun:.1f}" for begun, ended in windows)
    if not during:
        return [
            Row(f"snapshots among {count} raters", "skipped", "no rating came in during a snapshot"),
            all_there,
        ]
    return [
        Row(
            f"snapshots of {size_mb:.0f} MB among {count} raters, sqlite",
            f"rating p50 / p95 / p99 meanwhile, of {len(during)} (ms)",
            quantiles(during, 0.5, 0.95, 0.99),
            f"p95 < {p95:g}",
            percentile(during, 0.95) < p95,
        ),
        Row("", f"before and after, of {len(others)} (ms)", quantiles(others, 0.5, 0.95, 0.99)),
        Row("", "each took (s)", took),
        all_there,
    ]


def divided(tally: Tally, windows: list[Window]) -> tuple[list[float], list[float]]:
    """How long ratings took (ms) that were under way during a window, and how long the others did."""
    during: list[float] = []
    others: list[float] = []
    for sent, ms in zip(tally.rating_at, tally.rating_ms, strict=True):
        met = any(sent <= ended and sent + ms / 1000 >= begun for begun, ended in windows)
        (during if met else others).append(ms)
    return during, others


async def _watch(folder: Path, windows: list[Window]) -> None:
    """Note when an unfinished snapshot is there: it has a temporary name until it is complete."""
    begun = None
    while True:
        now, under_way = time.perf_counter(), any(folder.glob(".palpebra-*.sqlite"))
        if under_way and begun is None:
            begun = now
        elif not under_way and begun is not None:
            windows.append((begun, now))
            begun = None
        await asyncio.sleep(LOOK_S)


def scenarios(share: float, seconds: float, workers: int) -> dict[str, Callable[[], list[Row]]]:
    """By name; `share` of the raters and rows."""
    begin_at_once = int(1000 * share)
    return {
        "sqlite": lambda: steady("sqlite", int(300 * share), seconds, 1, 40, math.inf),
        "postgres": lambda: steady("postgres", int(1000 * share), seconds, workers, 60, math.inf),
        "starts": lambda: starts("sqlite", int(300 * share), int(300 * share), seconds / 2, 1, 150),
        "snapshots": lambda: snapshots(int(300 * share), seconds, int(STORED_ROWS * share), 150),
        "clips": lambda: proxied_clips(seconds / 4, 10),
        "burst": lambda: burst("sqlite", begin_at_once, 1) + burst("postgres", begin_at_once, workers),
        "many": lambda: steady("postgres", int(5000 * share), seconds, workers, math.inf, math.inf),
        "kill": lambda: under_fire(int(200 * share), seconds, workers),
        "otree": lambda: rated_on_otree(int(300 * share), seconds / 2),
        "export": lambda: export(int(EXPORTED_ROWS * share), EXPORTED_PER_S),
    }


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
    console.print(console_table(rows, "make load"))
    if asked.markdown:
        asked.markdown.write_text(markdown_table(rows), encoding="utf-8")
    return int(any(row.met is False for row in rows))


if __name__ == "__main__":
    sys.exit(main())
