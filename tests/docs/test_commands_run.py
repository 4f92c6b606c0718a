"""Every complete command line of README, how-to guides, explanation and reference runs as it is printed.

Page by page and in order, in a folder with files of the names that the pages use. Rules separate complete
commands from names and synopses (`is_complete`); what cannot run here is in `EXCEPTIONS` with the reason.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.app import create_app
from server.core.settings import Settings
from tests.conftest import REPOSITORY
from tests.docs.commands_inputs import write_inputs
from tests.docs.test_command_lines import BLOCK, PAGES, PROGRAMS, PrintedLine, printed_lines
from tests.helpers.studies import FROM_OWN_PAGE, Participant

LIMIT_S = 600
DECIDED = ("decisions", "tutorials", "generated")  # records, pages with a test of their own, generated pages
SERVES = "serves until it is stopped"
ELSEWHERE = "needs another host"
PEOPLE = "needs people's answers to all of exp3"
PERSON = "needs a video of a person: the detector does not read the synthetic actor"
OWN_SCREEN = "needs a recording of the reader's screen"
EXCEPTIONS = {
    "server run --host 127.0.0.1 --port 8000": SERVES,
    "server run --port 8000": SERVES,
    "server run --port 8001": SERVES,
    "server run --port 8765": SERVES,
    "server run": SERVES,
    "server restore s3://lab-backups/palpebra/palpebra-2026-01-31T030000.tar.age"
    " --identity backups.key": ELSEWHERE,
    "server database copy sqlite:///data/palpebra.sqlite postgresql://me@host/palpebra": ELSEWHERE,
    "stimuli scope slow_motion.mov --camera-fps 240 --frames 60 --out onsets.csv": OWN_SCREEN,
    "stimuli scope diode.csv --fps 30": OWN_SCREEN,
    "stimuli track face.mp4 --out track.csv --preview seen.mp4": PERSON,
    "stimuli track recordings --out tracks": PERSON,
    "stimuli bake recording me.mp4 --out characters/me": PERSON,
    "stimuli clip --character characters/me/ --profile real --out try.mp4": PERSON,
    "stimuli clip --character robot/ --profile real --out try.mp4": "needs the reader's own renders",
    "stimuli track recordings --model person.npz --out tracks": "needs a model of the reader's labels",
    "server capsule exp3 --out exp3-capsule.zip": PEOPLE,
    "analysis verify exp3-capsule.zip": PEOPLE,
    "analysis replicate p1203-acr --data downloads": "needs data that may not be shipped",
}
"""Complete commands that cannot run here, and why."""

RECIPES = {
    "face.mp4": "stimuli actor --seconds 8 --fps 120 --out face.mp4 --labels face.labels.json",
    "track.csv": "stimuli track face.mp4 --labels face.labels.json --out track.csv",
    "exp1.csv": "analysis synthesise exp1 --seed 7 --out exp1.csv",
    "blinks.profiles.csv": "stimuli blinks series.csv --column EAR_l --fps 240 --out blinks.csv",
}
"""How files are made that take a while: once, before the first page that names them."""

BEFORE_PEOPLE = "rm -r data && server study add exp3 --clips out/exp3 --open"
CREATE = "server admin create --password long-enough-1"
BEFORE = {
    "server workspace member perception-lab ada --role owner": f"{CREATE} ada",
    "server workspace grant exp3 bob --rights view,export": f"{CREATE} bob",
    "server workspace member vision anna --role experimenter": f"{CREATE} anna",
    "server link create lids --group fast": (
        "printf '\\n[groups]\\nby = \"link\"\\n' >> lids.toml && server study add lids.toml --clips my-clips"
    ),
    "stimuli checks lids.toml --out my-clips": (
        "printf '\\n[evidence]\\nonline_recruitment = true\\n' >> lids.toml"
    ),
    "server seal exp3 --power power.json --out exp3-seal.json": BEFORE_PEOPLE,
    "server seal exp3 --out exp3-seal.json": BEFORE_PEOPLE,
    'stimuli blinks "$track" --out "blinks/$name.csv" --summary "blinks/$name.json"'
    ' --report "blinks/$name.html"': (
        "stimuli actor --seconds 8 --fps 120 --out day1.mp4 --labels day1.json && mkdir tracks"
        " && stimuli track day1.mp4 --labels day1.json --out tracks/day1.csv"
    ),
    "server restore backups/palpebra-monday.tar": "mkdir aside && mv data/palpebra.sqlite* aside",
    "server database go-back 2026-11-24T10:15:00Z": (
        "server database snapshot && cd data/snapshots && mv *.sqlite palpebra-2026-11-24T100000Z.sqlite"
    ),
}
"""What the page asks for in words before a command."""

ANSWERS = {
    "server account reset-password anna": "long-enough-2\nlong-enough-2\n",
    "server person erase exp3 --id 5a9d0c2f": "y\n",
}
"""What a reader types where a command asks."""

PLACEHOLDER = re.compile(r"(?<![A-Za-z0-9_])[A-Z][A-Z_]+(?![A-Za-z0-9_])|\b[A-Z]\.[a-z]")
SYNOPSIS = re.compile(r"\.\.\.|\[|(?<=\w)\|(?=\w)")
MADE_FILE = re.compile(r'^name = "(\w+)"$', re.MULTILINE)


def is_complete(command: str, *, inline: bool) -> bool:
    """Whether it runs as printed: no placeholder, no synopsis, no mere name in running text."""
    unquoted = re.sub(r"'[^']*'|\"[^\"]*\"", "", without_comment(command))
    if PLACEHOLDER.search(unquoted) or SYNOPSIS.search(unquoted):
        return False
    words = shlex.split(without_comment(command).partition(" > ")[0])
    program: Any = PROGRAMS[words[0]]
    context = program.context_class(program, info_name=words[0])
    rest = words[1:]
    while hasattr(program, "get_command") and rest and not rest[0].startswith("-"):
        _, program, rest = program.resolve_command(context, rest)
        context = program.context_class(program, info_name=program.name, parent=context)
    if not rest:
        return not inline and not hasattr(program, "get_command")
    if not inline or not rest[0].startswith("-") or "--help" in rest:
        return True
    try:
        program.make_context(program.name, list(rest))
    except Exception:  # typer has its own copy of click's errors; an option alone is named, not used
        return False
    return True


def without_comment(command: str) -> str:
    """The command in the spelling of `EXCEPTIONS`."""
    return command.partition(" #")[0].strip()


def runs_here(command: str, *, inline: bool) -> bool:
    """Whether a command is complete and no exception."""
    return is_complete(command, inline=inline) and without_comment(command) not in EXCEPTIONS


def runnable_lines(page: Path) -> list[PrintedLine]:
    """What is run of a page: lines whose commands all run here, and the folders that blocks make."""
    lines = []
    for line in printed_lines(page.read_text(encoding="utf-8")):
        commands = line.commands()
        if line.text.startswith("mkdir ") or (
            commands and all(runs_here(command, inline=line.inline) for command in commands)
        ):
            lines.append(line)
    return lines


NOT_YET = (
    *("analysis", "blink-engine", "blinks", "clips", "models", "server", "tracking"),
    *("analyze-ratings", "animate-blinks", "check-participants", "many-recordings", "measure-blinks"),
    *("plan-the-sample", "replicate-studies", "scale-up", "share-a-study", "use-r-python-spss"),
    *("clip_rating", "continuous_rating", "paired_comparison", "threshold"),
)
"""Pages whose commands have not yet been seen to run, one after another, in this folder (issue 51)."""
RUN_PAGES = [
    page
    for page in PAGES
    if not {*DECIDED, *NOT_YET} & {*page.parts, page.stem}
    and any(line.commands() for line in runnable_lines(page))
]

QUICK = ("erase-a-person", "export-data", "recruit")
"""Pages that `make test` runs too."""


def page_name(page: Path) -> str:
    """The page from the repository's root."""
    return page.relative_to(REPOSITORY).as_posix()


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of the names that pages use, and a data folder with two studies; pages get copies."""
    folder = tmp_path_factory.mktemp("inputs")
    write_inputs(folder)
    for command in (
        "server study add lids.toml --clips my-clips --open",
        "server study add exp3 --clips out/exp3 --open",
        "server simulate lids --participants 8",
        "server simulate exp3 --participants 2",
    ):
        run_or_fail(command, folder)
    people = {"lids": [""] * 8, "exp3": ["5a9d0c2f", ""]}
    with TestClient(create_app(Settings(data_folder=folder / "data")), headers=FROM_OWN_PAGE) as client:
        for study, recruiter_ids in people.items():
            token = run_shell(f"server link create {study}", folder).stdout.strip().rpartition("/")[2]
            for recruiter_id in recruiter_ids:
                person = Participant(client, token)
                started = person.start(query={"participant": recruiter_id} if recruiter_id else {})
                assert started.status_code == 201, started.text
                assert person.request("PUT", "/consent", {"agreed": True}).status_code == 200
                if study == "lids":
                    person.rate_all()
    return folder


def make_named_files(text: str, inputs: Path) -> None:
    """Files of `RECIPES` that a page names, and those that their recipes name."""
    recipes = []
    for file, recipe in reversed(RECIPES.items()):
        if re.search(rf"(?<![\w/-]){re.escape(file)}\b", text):
            text += f"\n{recipe}"
            recipes.append((file, recipe))
    for file, recipe in reversed(recipes):
        if not (inputs / file).exists():
            run_or_fail(recipe, inputs)


def run_or_fail(command: str, folder: Path) -> None:
    """Run what prepares a page."""
    done = run_shell(command, folder)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"


def run_shell(text: str, folder: Path, answers: str = "") -> subprocess.CompletedProcess[str]:
    """As a reader would: the programs on the PATH, a data folder in the folder."""
    environment = {name: value for name, value in os.environ.items() if name != "DATABASE_URL"}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"
    environment["PALPEBRA_DATA_FOLDER"] = str(folder / "data")
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        input=answers,
        timeout=LIMIT_S,
    )


@pytest.mark.parametrize("page", [page for page in RUN_PAGES if page.stem not in QUICK], ids=page_name)
def test_commands_of_page_run(page: Path, inputs: Path, tmp_path: Path) -> None:
    assert not "\n".join(faults_of_page(page, inputs, tmp_path))


@pytest.mark.parametrize("page", [page for page in RUN_PAGES if page.stem in QUICK], ids=page_name)
def test_commands_of_quick_page_run(page: Path, inputs: Path, tmp_path: Path) -> None:
    assert not "\n".join(faults_of_page(page, inputs, tmp_path))


def faults_of_page(page: Path, inputs: Path, tmp_path: Path) -> list[str]:
    """Page, line and output of each line that fails in a copy of the inputs."""
    lines = runnable_lines(page)
    make_named_files("\n".join(line.text for line in lines), inputs)
    folder = tmp_path / "page"
    shutil.copytree(inputs, folder)
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block[1] == "toml" and (name := MADE_FILE.match(block[2])):
            (folder / f"{name[1]}.toml").write_text(block[2], encoding="utf-8")
    faults = []
    for line in lines:
        for command in line.commands():
            if before := BEFORE.get(without_comment(command)):
                run_or_fail(before, folder)
        done = run_shell(
            line.text, folder, "".join(ANSWERS.get(without_comment(c), "") for c in line.commands())
        )
        if done.returncode != 0:
            faults.append(
                f"{page_name(page)}:{line.line}: {line.text}\n{done.stdout[-500:]}{done.stderr[-1500:]}"
            )
    return faults


def test_exceptions_are_printed() -> None:
    printed = {
        without_comment(command)
        for page in PAGES
        if not set(DECIDED) & set(page.parts)
        for line in printed_lines(page.read_text(encoding="utf-8"))
        for command in line.commands()
        if is_complete(command, inline=line.inline)
    }
    assert set(EXCEPTIONS) <= printed
    assert len(printed) > 150
