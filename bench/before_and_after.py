"""What ratings, the start of a run, the commands, clips and pages cost compared with an earlier revision, in
one run.

    python -m bench.before_and_after [REVISION, default c84c2e8] [rounds, default 3] [parts, default all]

The parts are `ratings`, `commands`, `clips` and `pages`, with commas between them.

Both revisions run with the packages of this one, in turns, so that load and machine are the same for both.
Of the project only what every revision has is used: the tests' own server and participant.
"""

import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx2
import psutil

from bench.harness import ROOT, cpu_s_of, earlier_tree, figures_of, say, with_children
from tests.browser.server_process import ServerProcess
from tests.helpers.studies import SHORT, Participant

PEOPLE = 12
REPEATS = 10
ANALYSES = 3


def rating_path(folder: Path) -> dict[str, float]:
    """Of a real server: processor time and time of a rating, time from the link to the first trial."""
    declared = SHORT.replace("[blocks]", f"[blocks]\nrepeats = {REPEATS}")
    server = ServerProcess(folder / "data", **EVIDENCE)
    study = server.add_study(folder / "clips", declared)
    server.start()
    starts: list[float] = []
    each: list[float] = []
    try:
        assert server.process is not None
        pid = server.process.pid
        with httpx2.Client(base_url=server.address) as client:
            warm = Participant(client, study.link_token).agree()
            warm.answer_all()
            spent = 0.0
            for _ in range(PEOPLE):
                begun = time.perf_counter()
                person = Participant(client, study.link_token).agree()
                trials = person.state()["trials"]
                starts.append(time.perf_counter() - begun)
                person.answer_forms()
                before, begun = cpu_s_of(with_children(pid)), time.perf_counter()
                person.rate_all()
                spent += cpu_s_of(with_children(pid)) - before
                each.append((time.perf_counter() - begun) / len(trials))
    finally:
        server.stop()
    return {
        "processor time of a rating (ms)": 1000 * spent / (PEOPLE * len(trials)),
        "a rating, sent and acknowledged (ms)": 1000 * statistics.median(each),
        f"start of a run of {len(trials)} trials (ms)": 1000 * statistics.median(starts),
    }


def analysis(folder: Path) -> dict[str, float]:
    """`analysis run exp3` as a process, and without its models where it has them."""
    run = [sys.executable, "-c", "from analysis.cli import main; main()"]
    table = folder / "exp3.csv"
    subprocess.run([*run, "synthesise", "exp3", "--out", str(table)], check=True, stdout=subprocess.DEVNULL)
    told = subprocess.run([*run, "run", "--help"], check=True, capture_output=True, text=True).stdout
    plain = ["--no-sensitivity"] if "--no-sensitivity" in told else []
    return {
        "analysis run exp3 (s)": _shortest([*run, "run", "exp3", "--csv", str(table)], folder),
        "analysis run exp3, tables alone (s)": _shortest(
            [*run, "run", "exp3", "--csv", str(table), "--no-report", *plain], folder
        ),
    }


def commands(folder: Path) -> dict[str, float]:
    """Processor time of each program's `--help`, and of an ANOVA of a table of 20 participants."""
    figures = {}
    for program in ("server", "stimuli_builder", "analysis"):
        ask = [sys.executable, "-c", f"from {program}.cli import main; main()", "--help"]
        figures[f"{program} --help (s)"] = _least_processor_s(ask, folder)
    run = [sys.executable, "-c", "from analysis.cli import main; main()"]
    table = folder / "anova.csv"
    subprocess.run([*run, "synthesise", "exp3", "--out", str(table)], check=True, stdout=subprocess.DEVNULL)
    tested = [*run, "anova", str(table), "--within", "lower_lid", "--participant", "participant"]
    tested += ["--rating", "response"]
    figures["analysis anova (s)"] = _least_processor_s(tested, folder)
    return figures


def clips(folder: Path) -> dict[str, float]:
    """Processor time of the 160 clips of Exp 3, built by one process with nothing cached."""
    build = [sys.executable, "-c", "from stimuli_builder.cli import main; main()", "build", "exp3"]
    before = cpu_s_of([psutil.Process()])
    subprocess.run(
        [*build, "--out", str(folder / "clips"), "--workers", "1"], check=True, stdout=subprocess.DEVNULL
    )
    return {"clips of exp3 (s)": cpu_s_of([psutil.Process()]) - before}


def pages(folder: Path) -> dict[str, float]:
    """What each site loads at first, gzipped, counted by each revision, with the packages installed here."""
    frontend = Path("frontend").resolve()
    if not (frontend / "node_modules").exists():  # an earlier revision, in its first round
        (frontend / "node_modules").symlink_to(ROOT / "frontend" / "node_modules")
        for site in SITES:
            vite = ["node_modules/.bin/vite", "build", "-c", f"vite.{site}.config.ts", "--logLevel", "error"]
            subprocess.run(vite, check=True, stdout=sys.stderr, cwd=frontend)
    figures = {}
    for site in SITES:
        size = ["node", "scripts/bundle_size.mjs", site]
        said = subprocess.run(size, check=False, capture_output=True, text=True, cwd=frontend).stdout
        figures[f"{site} pages at first (KB, gzipped)"] = max(map(int, TOTAL.findall(said))) / 1024
    return figures


SITES = ("participant", "admin")
TOTAL = re.compile(r"^ *([0-9]+)  .*gzipped; budget", re.MULTILINE)


def _least_processor_s(command: list[str], folder: Path) -> float:
    # Of this process, which only waits, with that of children which have ended.
    spent = []
    for _ in range(ANALYSES):
        before = cpu_s_of([psutil.Process()])
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder)
        spent.append(cpu_s_of([psutil.Process()]) - before)
    return min(spent)


def _shortest(command: list[str], folder: Path) -> float:
    times = []
    for number in range(ANALYSES):
        begun = time.perf_counter()
        out = ["--out", str(folder / f"report-{number}-{len(command)}")]
        subprocess.run([*command, *out], check=True, stdout=subprocess.DEVNULL, cwd=folder)
        times.append(time.perf_counter() - begun)
    return min(times)


EVIDENCE = {"evidence": "record"} if os.environ.get("RECORDS_EVIDENCE") else {}


PARTS = {
    "ratings": lambda folder: rating_path(folder) | analysis(folder),
    "commands": commands,
    "clips": clips,
    "pages": pages,
}


def measured(tree: Path, folder: Path, parts: str) -> dict[str, float]:
    """One round of one revision."""
    settings = {"PALPEBRA_DATA_FOLDER": str(folder / "none")}
    server = tree / "server"
    if (server / "evidence").is_dir() or (server / "participation" / "evidence.py").is_file():
        settings["RECORDS_EVIDENCE"] = "1"  # as tests' participants bring none
    folder.mkdir()
    figures: dict[str, float] = figures_of(tree, __file__, folder, parts, **settings)
    return figures


def main(revision: str = "c84c2e8", rounds: str = "3", parts: str = ",".join(PARTS)) -> None:
    """Print each figure of both revisions, and the ratio."""
    before, after = [], []
    with tempfile.TemporaryDirectory() as temporary, earlier_tree(revision) as old:
        for number in range(int(rounds)):
            before.append(measured(old, Path(temporary, f"before-{number}"), parts))
            after.append(measured(ROOT, Path(temporary, f"after-{number}"), parts))
    say(f"{'load ' + ' '.join(f'{x:.1f}' for x in os.getloadavg()):<46} {revision:>9} {'here':>9} ratio")
    for name in before[0]:
        then = statistics.median(one[name] for one in before)
        now = statistics.median(one[name] for one in after)
        say(f"{name:<46} {then:>9.2f} {now:>9.2f} {now / then:>5.2f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["measure"]:
        figures: dict[str, float] = {}
        for part in sys.argv[3].split(","):
            figures |= PARTS[part](Path(sys.argv[2]))
        say(json.dumps(figures))
    else:
        main(*sys.argv[1:])
