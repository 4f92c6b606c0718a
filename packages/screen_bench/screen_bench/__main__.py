"""`make scope`: plays in real browsers, on a virtual display whose frame buffer is read from outside.

python -m screen_bench                        everything: rows of 200 plays, 100 views, 50 pairs (hours)
python -m screen_bench short                  rows of 20 plays idle and busy, 10 views, 10 pairs (20 minutes)
python -m screen_bench rows --plays 20 --conditions idle hogs --rates 30 60 --browsers chromium
python -m screen_bench views --tries 100      reload, kill -9, another device: views stored against seen
python -m screen_bench pairs --pairs 50       two clips on one canvas: are they ever a frame apart?
python -m screen_bench long --rates 30        clips of a minute: every frame there, and memory as before?

Each result is stored as it ends (--results FILE, best outside the project), rows in pieces of 40 plays, and
what is there is not measured again: a run that was stopped goes on where it was. Results of a page that drew
or judged otherwise stay in the file and do not count. --table prints the table of what is there.
--before-others: on a machine that others use too the browser goes before other programs in rows that are not
busy.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from screen_bench.browser import PROGRAMS, program
from screen_bench.compare import REFRESH_MS
from screen_bench.conditions import CONDITIONS
from screen_bench.display import Display, missing_here
from screen_bench.long import LONG_S, measure_long
from screen_bench.measure import Row, measure
from screen_bench.pairs import measure_pairs
from screen_bench.results import HEADER, Results, cells, markdown, measure_in_pieces, row_of
from screen_bench.views import count_views
from tests.browser.server_process import ServerProcess

RATES = (24, 25, 30, 50, 60)
PAIR_RATES = (30, 60)
LONG_PLAYS = 3
SHORT = {"plays": 20, "tries": 10, "pairs": 10, "rates": [30, 60], "conditions": ["idle", "hogs"]}


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="make scope", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "what", nargs="?", choices=("all", "short", "rows", "views", "pairs", "long"), default="all"
    )
    parser.add_argument("--plays", type=int, help="plays a row (200)")
    parser.add_argument("--tries", type=int, help="views to which something happens (100)")
    parser.add_argument("--pairs", type=int, help="pairs shown at each rate (50)")
    parser.add_argument("--browsers", nargs="+", choices=list(PROGRAMS), default=list(PROGRAMS))
    parser.add_argument("--rates", nargs="+", type=int, choices=RATES, metavar="FPS", help="of rows (all)")
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), help="of rows (all)")
    parser.add_argument(
        "--before-others",
        action="store_true",
        help="real-time priority for browsers in pairs, long clips and rows that are not busy (root)",
    )
    parser.add_argument(
        "--ordinary-display",
        action="store_true",
        help="let the display wait for the processor like any program",
    )
    parser.add_argument(
        "--results", type=Path, default=Path("out/scope.jsonl"), help="file of results (out/scope.jsonl)"
    )
    parser.add_argument(
        "--table", action="store_true", help="measure nothing, print the table of the results"
    )
    parser.add_argument("--again", action="store_true", help="measure what the file has already, too")
    options = parser.parse_args()
    full = {"plays": 200, "tries": 100, "pairs": 50, "rates": list(RATES), "conditions": list(CONDITIONS)}
    for name, value in (SHORT if options.what == "short" else full).items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    return options


@dataclass(frozen=True)
class Bench:
    """What every measurement needs."""

    options: argparse.Namespace
    display: Display
    server: ServerProcess
    folder: Path
    results: Results


@dataclass(frozen=True)
class Task:
    """One measurement: its key and how many, what it is in words, and how it is taken."""

    key: tuple[str, ...]
    count: int
    sentence: str
    take: Callable[[Bench], None]


def main() -> None:
    options = arguments()
    if options.table:
        _print(Results(options.results))
        return
    missing = missing_here() or ", ".join(f"no {name} here" for name in options.browsers if not program(name))
    if missing:
        sys.exit(f"error: {missing}")
    results = Results(options.results, options.again)
    with tempfile.TemporaryDirectory(prefix="palpebra-scope-") as made:
        folder = Path(made)
        (folder / "display").mkdir()
        server = ServerProcess(folder / "data")
        try:
            with Display(folder / "display", not options.ordinary_display) as display:
                server.start()
                print(f"display {display.name}, real-time priority: {'yes' if display.scan_out else 'no'}")
                _take_all(Bench(options, display, server, folder, results))
        finally:
            server.stop()
    _print(results)


def _take_all(bench: Bench) -> None:
    tasks = _tasks(bench.options)
    for number, task in enumerate(tasks, start=1):
        if bench.results.has(task.key, task.count):
            print(f"[{number}/{len(tasks)}] {task.sentence}: in {bench.results.path} already", flush=True)
            continue
        print(f"[{number}/{len(tasks)}] {task.sentence}", flush=True)
        try:
            task.take(bench)
        except (RuntimeError, ValueError) as error:
            print(f"    not measured: {error}", flush=True)


def _tasks(options: argparse.Namespace) -> list[Task]:
    every = options.what in ("all", "short")
    tasks: list[Task] = []
    for browser in options.browsers:
        if every or options.what == "views":
            tasks.append(_view_task(browser, options.tries))
        if every or options.what == "pairs":
            tasks += [_pair_task(browser, fps, options.pairs) for fps in PAIR_RATES]
        if options.what in ("all", "long"):
            rates = [fps for fps in options.rates if fps in PAIR_RATES]
            tasks += [_long_task(browser, fps) for fps in rates]
        if every or options.what == "rows":
            names = [name for name in options.conditions if browser in CONDITIONS[name].browsers]
            tasks += [_row_task(browser, fps, name, options.plays) for name in names for fps in options.rates]
    return tasks


def _row_task(browser: str, fps: int, name: str, plays: int) -> Task:
    condition = CONDITIONS[name]
    key = ("row", browser, str(fps), name)

    def take(bench: Bench) -> None:
        def piece(count: int) -> Row:
            before_others = bench.options.before_others
            return measure(
                bench.display, bench.server, bench.folder, browser, fps, condition, count, before_others
            )

        measure_in_pieces(bench.results, key, plays, piece)
        line = cells(_row(bench.results, key))
        print(
            "    " + ", ".join(f"{head}: {cell}" for head, cell in zip(HEADER[3:], line[3:], strict=True)),
            flush=True,
        )

    return Task(key, plays, f"{browser}, {fps} fps, {name}: {condition.sentence}", take)


def _row(results: Results, key: tuple[str, ...]) -> Row:
    """The row of all that the file holds of it."""
    return row_of([piece.details for piece in results.pieces(key)])


def _view_task(browser: str, tries: int) -> Task:
    key = ("views", browser)

    def take(bench: Bench) -> None:
        count = count_views(bench.display, bench.server, bench.folder, browser, tries)
        bench.results.add(key, tries, [count.line()], asdict(count))
        print(f"    {count.line()}", flush=True)

    return Task(key, tries, f"{browser}, views stored against views seen", take)


def _pair_task(browser: str, fps: int, pairs: int) -> Task:
    key = ("pairs", browser, str(fps))

    def take(bench: Bench) -> None:
        row = measure_pairs(
            bench.display, bench.server, bench.folder, browser, fps, pairs, bench.options.before_others
        )
        bench.results.add(key, pairs, [row.line()], asdict(row))
        print(f"    {row.line()}", flush=True)

    return Task(key, pairs, f"{browser}, {fps} fps, two clips on one canvas", take)


def _long_task(browser: str, fps: int) -> Task:
    key = ("long", browser, str(fps))

    def take(bench: Bench) -> None:
        row = measure_long(
            bench.display,
            bench.server,
            bench.folder,
            browser,
            fps,
            LONG_PLAYS,
            bench.options.before_others,
        )
        bench.results.add(key, LONG_PLAYS, [row.line()], asdict(row))
        print(f"    {row.line()}", flush=True)

    return Task(key, LONG_PLAYS, f"{browser}, {fps} fps, clips of {LONG_S:g} s", take)


def _print(results: Results) -> None:
    print(f"\nOne refresh is {REFRESH_MS:.1f} ms. Figures hold up to the frame buffer, not to the monitor.\n")
    rows = [cells(_row(results, key)) for key in results.keys("row")]
    if rows:
        print(markdown(rows))
    for kind in ("views", "pairs", "long"):
        for result in results.of(kind):
            print(f"\n{kind} ({result.at}): {result.cells[0]}")


if __name__ == "__main__":
    main()
