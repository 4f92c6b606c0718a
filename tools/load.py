"""`make load`: real servers under load and under fire; prints a table and stops by itself.

python tools/load.py                          everything, about eight minutes
python tools/load.py --seconds 20 --only sqlite
python tools/load.py --share 0.2              a fifth of the raters, for a small machine
"""

from __future__ import annotations

import argparse
import asyncio
import os
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rich.console import Console
from rich.table import Table
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from tools.load_client import LoadRater, Tally
from tools.load_server import ROOT, LoadServer, kill_postgres, load_server

EVERY_S = 6.0
EXPORTED_ROWS = 1_000_000
AT_ONCE_AT_START = 50
Rows = list[tuple[str, str, str]]


async def begin(server: LoadServer, count: int, tally: Tally, at_once: int) -> list[LoadRater]:
    """Raters with their visits begun, `at_once` at a time."""
    raters = [LoadRater(server.port, server.link, number, tally) for number in range(count)]
    gate = asyncio.Semaphore(at_once)

    async def one(rater: LoadRater) -> None:
        async with gate:
            await rater.begin()

    await asyncio.gather(*(one(rater) for rater in raters))
    return raters


async def rate(raters: list[LoadRater], seconds: float, fire: Callable[[int], None] | None) -> None:
    """Let them rate for so long; `fire` is called 20 times, evenly spread."""
    gate = asyncio.Semaphore(AT_ONCE_AT_START)

    async def prepared(rater: LoadRater) -> None:
        async with gate:
            await rater.prepare()

    await asyncio.gather(*(prepared(rater) for rater in raters))
    end = time.monotonic() + seconds
    work = [asyncio.create_task(rater.rate_until(end, EVERY_S)) for rater in raters]
    for number in range(20 if fire else 0):
        await asyncio.sleep(seconds / 21)
        await asyncio.to_thread(fire, number)
    await asyncio.gather(*work)


def stored(server: LoadServer, tally: Tally) -> tuple[int, int]:
    """Acknowledged ratings that are not in the database as sent, and ratings stored twice."""
    with server.services.database.read() as session:
        found = dict(map(tuple, session.execute(text("SELECT rating_id, response FROM trial_ratings"))))
        plays = session.execute(
            text(
                "SELECT count(*) FROM (SELECT 1 FROM trial_ratings "
                "GROUP BY study_run_id, trial_index, play HAVING count(*) > 1) AS twice"
            )
        ).scalar_one()
    lost = sum(found.get(rating_id, "none") != value for rating_id, value in tally.acknowledged.items())
    return lost, int(plays)


def steady(kind: str, count: int, seconds: float, workers: int) -> Rows:
    """`count` raters, a clip and a rating each 6 s."""
    tally = Tally()
    with load_server(kind, workers) as server:

        async def go() -> float:
            raters = await begin(server, count, tally, AT_ONCE_AT_START)
            used = server.cpu_s()
            await rate(raters, seconds, None)
            return server.cpu_s() - used

        used = asyncio.run(go())
        lost, twice = stored(server, tally)
        stopping = server.stop()
    ratings = len(tally.rating_ms)
    name = f"{count} raters, {kind}, {workers} worker(s), {seconds:.0f} s"
    p = tally.percentile
    return [
        (name, "ratings; failed starts", f"{ratings}; {tally.failed_starts}"),
        (
            "",
            "rating p50 / p95 / p99 (ms)",
            " / ".join(f"{p(tally.rating_ms, q):.0f}" for q in (0.5, 0.95, 0.99)),
        ),
        ("", "clip p95 (ms)", f"{p(tally.clip_ms, 0.95):.0f}"),
        ("", "server CPU per rating (ms), its clip included", f"{1000 * used / max(1, ratings):.2f}"),
        ("", "lost; stored twice; retries", f"{lost}; {twice}; {tally.retries}"),
        ("", "graceful stop (s)", f"{stopping:.1f}"),
    ]


def burst(kind: str, count: int, workers: int) -> Rows:
    """`count` run starts at the same moment."""
    tally = Tally()
    with load_server(kind, workers) as server:
        asyncio.run(begin(server, count, tally, count))
        with server.services.database.read() as session:
            rows = session.execute(
                text(
                    "SELECT study_run_id, version_clip_id, block, block_label FROM assigned_trials "
                    "WHERE kind = 'main' ORDER BY study_run_id, trial_index"
                )
            ).all()
    orders: dict[int, list[int]] = {}
    firsts: Counter[str] = Counter()
    for run, clip, _block, label in rows:
        firsts[label] += run not in orders
        orders.setdefault(run, []).append(clip)
    distinct = len({tuple(order) for order in orders.values()})
    spread = max(firsts.values()) - min(firsts.values()) if len(firsts) > 1 else count
    return [
        (
            f"burst of {count} starts, {kind}",
            "failed; p95 (ms)",
            f"{tally.failed_starts}; {tally.percentile(tally.start_ms, 0.95):.0f}",
        ),
        ("", "distinct orders; first blocks differ by", f"{distinct} of {len(orders)}; {spread}"),
    ]


def under_fire(count: int, seconds: float, workers: int) -> Rows:
    """20 kill -9 of server workers and 5 of PostgreSQL's processes while ratings arrive."""
    tally, kills = Tally(), Counter[str]()
    with load_server("postgres", workers) as server:

        def fire(number: int) -> None:
            server.kill_worker(number)
            kills["worker"] += 1
            if number % 4 == 2:
                try:
                    kill_postgres(server)
                    kills["postgres"] += 1
                except DBAPIError:
                    kills["postgres was still recovering"] += 1

        async def go() -> None:
            raters = await begin(server, count, tally, AT_ONCE_AT_START)
            await rate(raters, seconds, fire)

        asyncio.run(go())
        time.sleep(2)
        server.services.database.engine.dispose()
        lost, twice = stored(server, tally)
    said = ", ".join(f"{number} x {what}" for what, number in kills.items())
    return [
        (f"kill -9, {count} raters, postgres, {seconds:.0f} s", "killed", said),
        ("", "acknowledged; lost; stored twice", f"{len(tally.acknowledged)}; {lost}; {twice}"),
        ("", "requests sent again; given up", f"{tally.retries}; {tally.given_up}"),
    ]


def export(rows: int) -> Rows:
    """The CSV of so many rows: speed, and the memory of the process that writes it."""
    tally = Tally()
    with load_server("sqlite", 1) as server:

        async def go() -> None:
            await rate(await begin(server, 50, tally, 50), 12, None)

        asyncio.run(go())
        multiply(server, rows)
        environment = {**os.environ, "DATABASE_URL": server.settings.database_url}
        environment["PALPEBRA_DATA_FOLDER"] = str(server.settings.data_folder)
        out = server.settings.data_folder / "out.csv"
        command = [sys.executable, "-m", "server", "export", "short", "--out", str(out)]
        began = time.monotonic()
        subprocess.run(command, env=environment, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        seconds = time.monotonic() - began
        with out.open(encoding="utf-8") as stream:
            written = sum(1 for _ in stream) - 1
        peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    speed = f"{written}; {written / seconds:.0f}; {peak_mb:.0f}"
    return [
        ("export to CSV, sqlite", "rows; rows/s (start of the program included); peak MB of a child", speed)
    ]


def multiply(server: LoadServer, rows: int) -> None:
    """Copy stored ratings as further plays until there are `rows`."""
    with server.services.database.write_connection() as connection:
        columns = [row[1] for row in connection.exec_driver_sql("PRAGMA table_info(trial_ratings)")]
        there = connection.exec_driver_sql("SELECT count(*) FROM trial_ratings").scalar_one()
        changed = {"id": "NULL", "rating_id": "rating_id || '-' || n", "play": "play + n", "drawn": "NULL"}
        values = ", ".join(changed.get(column, column) for column in columns)
        connection.exec_driver_sql(
            "WITH RECURSIVE series(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM series "
            f"WHERE n < {rows // there}) "
            f"INSERT INTO trial_ratings ({', '.join(columns)}) SELECT {values} FROM trial_ratings, series"
        )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60, help="length of each steady phase (60)")
    parser.add_argument("--share", type=float, default=1, help="share of the raters and rows (1)")
    parser.add_argument("--workers", type=int, default=2, help="server workers on PostgreSQL (2)")
    parser.add_argument("--only", nargs="*", help="sqlite, postgres, burst, many, kill, export")
    asked = parser.parse_args()
    share, seconds, workers = asked.share, asked.seconds, asked.workers
    scenarios: dict[str, Callable[[], Rows]] = {
        "sqlite": lambda: steady("sqlite", int(300 * share), seconds, 1),
        "postgres": lambda: steady("postgres", int(1000 * share), seconds, workers),
        "burst": lambda: (
            burst("sqlite", int(1000 * share), 1) + burst("postgres", int(1000 * share), workers)
        ),
        "many": lambda: steady("postgres", int(5000 * share), seconds, workers),
        "kill": lambda: under_fire(int(200 * share), seconds, workers),
        "export": lambda: export(int(EXPORTED_ROWS * share)),
    }
    # Ended from outside it still stops its servers: SystemExit passes every `finally`.
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(143))
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(
        resource.RLIMIT_NOFILE, (hard if hard != resource.RLIM_INFINITY else max(soft, 65536), hard)
    )
    console = Console(width=120)
    load = os.getloadavg()[0]
    console.print(
        f"{os.cpu_count()} cores, load of the machine before: {load:.1f}; clients run on the same cores"
    )
    table = Table("scenario", "what", "measured", title="make load")
    for name in asked.only or scenarios:
        console.print(f"{name} ...", end="\n")
        for row in scenarios[name]():
            table.add_row(*row)
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
