"""What `make load` does to a server, and what it says of it."""

from __future__ import annotations

import asyncio
import math
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Coroutine, Iterable
from typing import Any

import uvloop
from sqlalchemy import text

from tools.load_client import LoadRater, Tally, percentile
from tools.load_measures import Clocks, Row, quantiles, saved
from tools.load_server import ROOT, LoadServer, load_server

EVERY_S = 6.0
AT_ONCE_AT_START = 50
WORKER_KILLS, DATABASE_KILLS = 20, 5


def run(work: Coroutine[Any, Any, None]) -> None:
    """As asyncio.run, on the faster loop: the raters share the cores with the server."""
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(work)


async def begin(server: LoadServer, count: int, tally: Tally, at_once: int) -> list[LoadRater]:
    """Raters with their visits begun, `at_once` at a time."""
    raters = [LoadRater(server.port, server.link, number, tally) for number in range(count)]
    gate = asyncio.Semaphore(at_once)

    async def one(rater: LoadRater) -> None:
        async with gate:
            await rater.begin()

    await asyncio.gather(*(one(rater) for rater in raters))
    return raters


async def prepare(raters: list[LoadRater]) -> None:
    """Consent and list of trials of all."""
    gate = asyncio.Semaphore(AT_ONCE_AT_START)

    async def one(rater: LoadRater) -> None:
        async with gate:
            await rater.prepare()

    await asyncio.gather(*(one(rater) for rater in raters))


async def rate(raters: list[LoadRater], seconds: float, fire: Callable[[int], None] | None = None) -> None:
    """Let them rate for so long; `fire` is called WORKER_KILLS times, evenly spread."""
    end = time.monotonic() + seconds
    work = [asyncio.create_task(rater.rate_until(end, EVERY_S)) for rater in raters]
    if fire is not None:
        for number in range(WORKER_KILLS):
            await asyncio.sleep(seconds / (WORKER_KILLS + 1))
            await asyncio.to_thread(fire, number)
    await asyncio.gather(*work)


def rated(server: LoadServer, count: int, seconds: float) -> tuple[Tally, Clocks]:
    """What `count` raters saw, and the clocks since they all had begun; they are read when this ends."""
    tally, clocks = Tally(), []

    async def go() -> None:
        raters = await begin(server, count, tally, AT_ONCE_AT_START)
        await prepare(raters)
        clocks.append(Clocks(server))
        await rate(raters, seconds)
        clocks[0].stop()

    run(go())
    return tally, clocks[0]


def steady(kind: str, count: int, seconds: float, workers: int, p95: float, p99: float) -> list[Row]:
    """`count` raters, a clip and a rating each 6 s; `p95` and `p99` are limits in ms, infinite where none."""
    with load_server(kind, workers) as server:
        tally, clocks = rated(server, count, seconds)
        costs = clocks.rows(len(tally.rating_ms))
        all_there = saved(server, tally)
        stopping = server.stop()
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
        with server.services.database.read() as session:
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
        server.services.database.engine.dispose()
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
