"""What one revision of the program costs, as JSON; `before_and_after.py` runs it in the tree of each.

    PYTHONPATH=TREE python one_revision.py FOLDER

Only what every revision has is used: the tests' own server and participant.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import httpx2
import psutil

from tests.browser.server_process import ServerProcess
from tests.helpers.studies import SHORT, Participant

PEOPLE = 12
REPEATS = 10
ANALYSES = 3


def cpu_s(process: psutil.Process) -> float:
    """Processor time of a process and its children."""
    every = [process, *process.children(recursive=True)]
    return sum(sum(one.cpu_times()[:2]) for one in every)


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
        process = psutil.Process(server.process.pid)
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
                before, begun = cpu_s(process), time.perf_counter()
                person.rate_all()
                spent += cpu_s(process) - before
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


def _shortest(command: list[str], folder: Path) -> float:
    times = []
    for number in range(ANALYSES):
        begun = time.perf_counter()
        out = ["--out", str(folder / f"report-{number}-{len(command)}")]
        subprocess.run([*command, *out], check=True, stdout=subprocess.DEVNULL, cwd=folder)
        times.append(time.perf_counter() - begun)
    return min(times)


EVIDENCE = {"evidence": "record"} if os.environ.get("RECORDS_EVIDENCE") else {}

if __name__ == "__main__":
    target = Path(sys.argv[1])
    sys.stdout.write(json.dumps(rating_path(target) | analysis(target)))
