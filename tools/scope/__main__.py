"""`make scope`: plays in real browsers, on a virtual display whose frame buffer is read from outside.

python -m tools.scope                                    all rows, 200 plays each (hours)
python -m tools.scope --plays 20 --conditions idle hogs --rates 30 60 --browsers chromium
python -m tools.scope --before-others                    on a machine that others use too: in rows that are
                                                         not busy the browser goes before other programs
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from tests.browser.server_process import ServerProcess
from tools.scope.browser import PROGRAMS, program
from tools.scope.compare import REFRESH_MS
from tools.scope.conditions import CONDITIONS
from tools.scope.display import Display, missing_here
from tools.scope.measure import Row, measure
from tools.scope.table import HEADER, as_json, cells, markdown

RATES = (24, 25, 30, 50, 60)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="make scope", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--plays", type=int, default=200, help="plays a row (200)")
    parser.add_argument("--browsers", nargs="+", choices=list(PROGRAMS), default=list(PROGRAMS))
    parser.add_argument("--rates", nargs="+", type=int, choices=RATES, default=list(RATES), metavar="FPS")
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), default=list(CONDITIONS))
    parser.add_argument(
        "--before-others",
        action="store_true",
        help="real-time priority for browsers in rows that are not busy (root)",
    )
    parser.add_argument(
        "--ordinary-display",
        action="store_true",
        help="let the display wait for the processor like any program",
    )
    parser.add_argument("--json", type=Path, help="write every play here")
    return parser.parse_args()


def main() -> None:
    options = arguments()
    missing = missing_here() or ", ".join(f"no {name} here" for name in options.browsers if not program(name))
    if missing:
        sys.exit(f"error: {missing}")
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="palpebra-scope-") as made:
        folder = Path(made)
        (folder / "display").mkdir()
        server = ServerProcess(folder / "data")
        try:
            with Display(folder / "display", not options.ordinary_display) as display:
                server.start()
                print(f"display {display.name}, real-time priority: {'yes' if display.scan_out else 'no'}")
                _measure_all(options, display, server, folder, rows)
        finally:
            server.stop()
    _print(rows)
    if options.json:
        options.json.write_text(json.dumps(as_json(rows)), encoding="utf-8")


def _measure_all(
    options: argparse.Namespace, display: Display, server: ServerProcess, folder: Path, rows: list[Row]
) -> None:
    planned = [
        (browser, fps, CONDITIONS[name])
        for browser in options.browsers
        for name in options.conditions
        for fps in options.rates
        if browser in CONDITIONS[name].browsers
    ]
    for number, (browser, fps, condition) in enumerate(planned, start=1):
        print(
            f"[{number}/{len(planned)}] {browser}, {fps} fps, {condition.name}: {condition.sentence}",
            flush=True,
        )
        try:
            row = measure(
                display, server, folder, browser, fps, condition, options.plays, options.before_others
            )
        except (RuntimeError, ValueError) as error:
            print(f"    not measured: {error}", flush=True)
            continue
        rows.append(row)
        print(
            "    "
            + ", ".join(f"{head}: {cell}" for head, cell in zip(HEADER[3:], cells(row)[3:], strict=True)),
            flush=True,
        )


def _print(rows: list[Row]) -> None:
    print(f"\nOne refresh is {REFRESH_MS:.1f} ms. Figures hold up to the frame buffer, not to the monitor.\n")
    print(markdown(rows))


if __name__ == "__main__":
    main()
