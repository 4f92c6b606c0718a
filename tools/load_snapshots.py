"""What raters see while the server takes a snapshot of its SQLite database, watched from outside."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

from server.operations.snapshots import FOLDER, database_file
from tools.load_client import Tally, percentile
from tools.load_measures import Row, quantiles, saved
from tools.load_scenarios import AT_ONCE_AT_START, EVERY_S, begin, multiply, prepare, rate, run
from tools.load_server import load_server

EVERY_MINUTES = 0.4
LOOK_S = 0.02
FILLERS = 20
Window = tuple[float, float]
"""When a snapshot began and ended, on the clock of the raters' answers."""


def snapshots(count: int, seconds: float, stored_rows: int, p95: float) -> list[Row]:
    """`count` raters on a database with so many ratings, of which the server takes snapshots meanwhile."""
    tally, windows = Tally(), list[Window]()
    with load_server("sqlite", 1, PALPEBRA_SNAPSHOT_MINUTES=str(EVERY_MINUTES)) as server:
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
    """Note when an unfinished snapshot is there: it has a name of its own until it is whole."""
    begun = None
    while True:
        now, under_way = time.perf_counter(), any(folder.glob(".palpebra-*.sqlite"))
        if under_way and begun is None:
            begun = now
        elif not under_way and begun is not None:
            windows.append((begun, now))
            begun = None
        await asyncio.sleep(LOOK_S)
