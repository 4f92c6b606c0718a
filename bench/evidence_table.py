"""`make evidence`: people and programs of every kind take part, and which signal each of them triggers.

python -m bench.evidence_table --runs 200 --honest 1000   a separate study, `server simulate` once per manner
python -m bench.evidence_table --out FOLDER               keep MANNER.json files there, and go on
python -m bench.evidence_table --folder FOLDER            the table of MANNER.json files that are there
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from server.context import open_services
from server.core.migrate import upgrade
from server.core.settings import Settings
from server.participation.evidence import BANDS, GUESSED_BY_CHANCE, VERDICTS, points_of
from server.rehearsals.manners import MANNERS
from tests.helpers.motion_checks import CHECKS, checked
from tests.helpers.studies import SHORT, add_study

Run = dict[str, Any]
STUDY = "evidence"
# 36 clips of three seconds, two attention and ten motion checks, warnings as they are by default.
MOTION_CHECKS = (
    CHECKS.replace("per_block = 2", "per_block = 5")
    .replace('"digit", "direction"', '"direction", "shape"')
    .replace("clips = 12", "clips = 24")
)
TEXT = checked(
    SHORT.replace("per_cell = 2", "per_cell = 9").replace('"short"', f'"{STUDY}"', 1), MOTION_CHECKS
)
RULES = "".join(
    f'[[warnings.rules]]\nrule = "{rule}"\n\n' for rule in ("same_answer", "repeated_pattern", "fast_answers")
)
CLIP_FRAMES = 90
NEVER_LIKELY = ("http", "http-slow", "script", "scripted")


def main() -> int:
    """Print the table; 1 where it does not say what it must."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    asked.add_argument("--runs", type=int, default=200, help="of each manner but the honest one (200)")
    asked.add_argument("--honest", type=int, default=1000, help="honest runs (1000)")
    asked.add_argument("--seed", type=int, default=1, help="of the first manner; others follow (1)")
    asked.add_argument("--only", nargs="+", choices=list(MANNERS), default=list(MANNERS), help="manners")
    asked.add_argument("--folder", type=Path, help="take the files that lie here, and run nothing")
    asked.add_argument("--out", type=Path, help="keep the files here, and go on where some are")
    options = asked.parse_args()
    if options.folder is not None:
        runs = {
            name: read(options.folder, name)
            for name in MANNERS
            if (options.folder / f"{name}.json").is_file()
        }
    else:
        counts = {name: options.honest if name == "honest" else options.runs for name in options.only}
        with tempfile.TemporaryDirectory() as folder:
            runs = simulated(Path(folder), options.out or Path(folder), counts, options.seed)
    if not runs:
        sys.stderr.write("error: expected MANNER.json files of `server simulate --as`, found none\n")
        return 2
    sys.stdout.write(table(runs) + "\n")
    faults = broken(runs)
    sys.stderr.writelines(f"error: {fault}\n" for fault in faults)
    return int(bool(faults))


def simulated(data: Path, out: Path, counts: dict[str, int], first_seed: int) -> dict[str, list[Run]]:
    """The runs of each manner on a new study, each by the command that anybody may give."""
    settings = Settings(data_folder=data, database_url=f"sqlite:///{data / 'palpebra.sqlite'}")
    services = open_services(settings)
    upgrade(services.database)
    add_study(services, data / "clips to add", f"{TEXT}\n[warnings]\n{RULES}", frames=CLIP_FRAMES)
    services.database.close()
    environment = {**os.environ, "PALPEBRA_DATA_FOLDER": str(data), "DATABASE_URL": settings.database_url}
    out.mkdir(parents=True, exist_ok=True)
    seeds = {name: seed for seed, name in enumerate(MANNERS, start=first_seed)}
    for name, count in counts.items():
        seed, begun = seeds[name], time.monotonic()
        if (out / f"{name}.json").is_file() and len(read(out, name)) == count:
            sys.stderr.write(f"{name}: {count} runs are there\n")
            continue
        command = [sys.executable, "-m", "server", "simulate", STUDY, "--as", name, "--seed", str(seed)]
        command += ["--participants", str(count), "--at-once", "2", "--json", str(out / f"{name}.json")]
        subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
        sys.stderr.write(f"{name}: {count} runs in {time.monotonic() - begun:.0f} s\n")
    return {name: read(out, name) for name in counts}


def read(folder: Path, name: str) -> list[Run]:
    """The runs in the file of a manner."""
    runs: list[Run] = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))["runs"]
    return runs


def table(runs: dict[str, list[Run]]) -> str:
    """One column per kind of rater, one row per verdict and signal, as Markdown."""
    rows: list[tuple[str, Mapping[str, int | str]]] = [
        ("Runs", {name: len(verdicts) for name, verdicts in runs.items()})
    ]

    def count(title: str, counted: Callable[[Run], float]) -> None:
        rows.append((title, {name: int(sum(map(counted, verdicts))) for name, verdicts in runs.items()}))

    count("Answers refused", lambda run: sum(run["refused"].values()))
    for verdict in VERDICTS[:3]:
        count(f"Verdict `{verdict}`", lambda run, verdict=verdict: run["verdict"] == verdict)  # type: ignore[misc]
    count("Warned", lambda run: bool(run["warned"]))
    count("Ended after warnings", lambda run: run["ended"])
    rows.append(("Motion checks right", {name: _percent(verdicts) for name, verdicts in runs.items()}))
    count("Motion checks passed", passed)
    for signal in BANDS:
        count(f"`{signal}` against", lambda run, signal=signal: speaks_against(run, signal))  # type: ignore[misc]
    lines = ["| | " + " | ".join(runs) + " |", "|---|" + "--:|" * len(runs)]
    lines += [
        f"| {title} | " + " | ".join(str(cells[name] or "") for name in runs) + " |" for title, cells in rows
    ]
    return "\n".join(lines)


def passed(run: Run) -> bool:
    """Whether a run was right in more motion checks than guesses are."""
    chance = run["signals"].get("motion_checks_guessed")
    return chance is not None and chance < GUESSED_BY_CHANCE


def _percent(verdicts: list[Run]) -> str:
    asked = [
        (run["signals"].get("motion_checks"), run["signals"].get("motion_checks_asked")) for run in verdicts
    ]
    told = [(share * number, number) for share, number in asked if share is not None and number]
    return (
        f"{100 * sum(right for right, _ in told) / sum(number for _, number in told):.1f} %" if told else ""
    )


def speaks_against(run: Run, signal: str) -> bool:
    """Whether a signal takes points from a run that has answers."""
    return bool(run["answers"]) and points_of(signal, run["signals"].get(signal)) < 0


def broken(runs: dict[str, list[Run]]) -> list[str]:
    """What the table must say and does not."""
    faults = []
    for name in NEVER_LIKELY:
        likely = sum(run["verdict"] == "likely" for run in runs.get(name, []))
        if likely:
            faults.append(f"{name}: expected no run likely a person's, got {likely}")
    honest = Counter(run["verdict"] == "likely" for run in runs.get("honest", []))
    if honest[False] >= 0.01 * honest.total() > 0:
        faults.append(f"honest: expected under 1% not likely, got {honest[False]} of {honest.total()}")
    by_frames = runs.get("frames", [])
    if sum(map(passed, by_frames)) >= 0.01 * len(by_frames) > 0:
        faults.append(f"frames: motion checks passed by {sum(map(passed, by_frames))} of {len(by_frames)}")
    for name, low, high in (("careless", 0.9, 1.01), ("honest", -0.01, 0.01)):
        verdicts = runs.get(name, [])
        warned = sum(bool(run["warned"]) for run in verdicts)
        if verdicts and not low * len(verdicts) < warned < high * len(verdicts):
            faults.append(f"{name}: warned {warned} of {len(verdicts)}")
    return faults


if __name__ == "__main__":
    sys.exit(main())
