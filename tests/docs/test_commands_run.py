"""Every complete command line of README, how-to guides, explanation and reference runs as it is printed.

Page by page and in order, in a folder with files of the names that the pages use. Rules separate complete
commands from names and synopses (`is_complete`); what cannot run here is in `EXCEPTIONS` with the reason.
"""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from sqlalchemy.engine import make_url

from server.core.locks import file_lock
from tests.analysis.report.r_process import r_has
from tests.conftest import REPOSITORY
from tests.docs.commands_inputs import (
    take_part,
    write_filmed_screen,
    write_inputs,
    write_person,
    write_recording_with_track,
)
from tests.docs.test_command_lines import BLOCK, PAGES, PROGRAMS, PrintedLine, printed_lines, words_of
from tests.helpers.databases import run_as_admin, started_postgres
from tests.helpers.ports import free_port

LIMIT_S = 1200
DECIDED = ("decisions", "tutorials", "generated")  # records, pages with a test of their own, generated pages
EXCEPTIONS = {
    "palpebra serve --domain lab.example.org": (
        "needs a domain; tests/palpebra/test_https.py serves one with an authority on the same machine"
    ),
    "stimuli bake recording me.mp4 --out characters/me": (
        "needs a video of a person: in the generated one the detector sees no eye close fully"
    ),
    "analysis replicate p1203-acr --data downloads": "needs data that may not be shipped",
}
"""Complete commands that cannot run here, and why."""
if not r_has("afex", "car", "emmeans"):
    EXCEPTIONS["analysis run exp1 --csv exp1.csv --verify-with-r"] = "needs R with afex"

ENDS_WITH_1 = (
    "analysis synthesise exp1 --n 60 --effect blur:amplitude=12.5 --effect character=8",  # the page says so
)
"""Commands that report something with exit code 1, as their pages say."""

RESTORE_FROM_BUCKET = (
    "server restore s3://lab-backups/palpebra/palpebra-2026-01-31T030000.tar.age --identity backups.key"
)


def back_up_to_bucket(folder: Path) -> None:
    """The page's bucket, at a server of S3's protocol, with a backup of its name; the data are aside."""
    moto = pytest.importorskip("moto.server", reason="moto is not installed")
    boto3 = pytest.importorskip("boto3", reason="the extra s3 is not installed")
    store = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    store.start()
    host, port = store.get_host_and_port()
    os.environ["PALPEBRA_S3_ENDPOINT"] = endpoint = f"http://{host}:{port}"
    os.environ["AWS_ACCESS_KEY_ID"] = os.environ["AWS_SECRET_ACCESS_KEY"] = "test"
    client = boto3.client("s3", endpoint_url=endpoint, region_name="us-east-1")
    client.create_bucket(Bucket="lab-backups")
    public = re.search(r"age1\w+", (folder / "backups.key").read_text(encoding="utf-8"))
    assert public is not None
    run_or_fail(f"server backup --to s3://lab-backups/palpebra --recipient {public[0]}", folder)
    names = [entry["Key"] for entry in client.list_objects_v2(Bucket="lab-backups")["Contents"]]
    (made,) = [name for name in names if name.endswith(".tar.age")]
    printed = RESTORE_FROM_BUCKET.split()[2].removeprefix("s3://lab-backups/")
    client.copy_object(Bucket="lab-backups", Key=printed, CopySource={"Bucket": "lab-backups", "Key": made})
    run_or_fail("mkdir aside-2 && mv data/palpebra.sqlite* aside-2", folder)


def serve_postgresql(_folder: Path) -> None:
    """The page's database and user, at a port to which libpq takes every host's name."""
    server = make_url(started_postgres())
    for statement in ("CREATE ROLE me LOGIN", "CREATE DATABASE palpebra OWNER me"):
        run_as_admin(server, statement)
    socket_folder = str(server.query["host"])
    listener = socket.create_server(("127.0.0.1", 0))
    os.environ |= {"PGHOSTADDR": "127.0.0.1", "PGPORT": str(listener.getsockname()[1])}

    def carry(source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while part := source.recv(65536):
                target.sendall(part)
            target.shutdown(socket.SHUT_WR)

    def connect(outer: socket.socket) -> None:
        with outer, socket.socket(socket.AF_UNIX) as inner:
            inner.connect(f"{socket_folder}/.s.PGSQL.5432")
            back = threading.Thread(target=carry, args=(inner, outer), daemon=True)
            back.start()
            carry(outer, inner)
            back.join()

    def accept() -> None:
        while True:
            threading.Thread(target=connect, args=(listener.accept()[0],), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()


@pytest.fixture(autouse=True)
def same_environment() -> Iterator[None]:
    """What a page needs of the environment is not left to the next one."""
    with mock.patch.dict(os.environ):
        yield


Step = str | Callable[[Path], None]
RECIPES: dict[str, Step] = {
    "face.mp4": write_person,
    "me.mp4": write_recording_with_track,
    "slow_motion.mov": write_filmed_screen,
    "track.csv": "stimuli track face.mp4 --labels face.labels.json --out track.csv",
    "exp1.csv": "analysis synthesise exp1 --seed 7 --out exp1.csv",
    "blinks.profiles.csv": "stimuli blinks series.csv --column EAR_l --fps 240 --out blinks.csv",
}
"""How files are made that take a while: once, before the first page that names them."""

BEFORE_PEOPLE = "rm -r data && server study add exp3 --clips out/exp3 --open"
CREATE = "server admin create --password long-enough-1"
BEFORE: dict[str, Step] = {
    "analysis run exp3": "server simulate exp3 --participants 4",
    "analysis run exp3 --csv exp3.csv --out again": "server export exp3 --out exp3.csv",
    "server database upgrade": "rm -r data",
    "server workspace member perception-lab ada --role owner": f"{CREATE} ada",
    "server workspace grant exp3 bob --rights view,export": f"{CREATE} bob",
    "server workspace member vision anna --role experimenter": f"{CREATE} anna",
    "server workspace member default anna --remove": f"{CREATE} zoe",
    "server link create lids --group fast": (
        "printf '\\n[groups]\\nby = \"link\"\\n' >> lids.toml && server study add lids.toml --clips my-clips"
    ),
    "stimuli checks lids.toml --out my-clips": (
        "printf '\\n[evidence]\\nonline_recruitment = true\\n' >> lids.toml"
    ),
    "server seal exp3 --power power.json --out exp3-seal.json": BEFORE_PEOPLE,
    "server capsule exp3 --out exp3-capsule.zip": lambda folder: take_part(folder, "exp3", 4),
    "stimuli track recordings --out tracks": "rm recordings/* && cp face.mp4 recordings/day1.mp4",
    "stimuli track recordings --model person.npz --out tracks": (
        "rm tracks/day1.csv && stimuli train face.mp4 --labels face.labels.json --out person.npz"
    ),
    "stimuli clip --character characters/me/ --profile real --out try.mp4": (
        "stimuli bake recording me.mp4 me.csv --out characters/me"
    ),
    RESTORE_FROM_BUCKET: back_up_to_bucket,
    "server database copy sqlite:///data/palpebra.sqlite postgresql://me@host/palpebra": serve_postgresql,
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

PLACEHOLDER = re.compile(r"(?<![A-Za-z0-9_])[A-Z][A-Z_]+(?![A-Za-z0-9_=])|\b[A-Z]\.[a-z]")
SYNOPSIS = re.compile(r"\.\.\.|\[|(?<=\w)\|(?=\w)")
SERVES = re.compile(r"(?:palpebra(?: start| demo)?|server run)(?: --.*)?")
MADE_FILE = re.compile(r'^name = "(\w+)"$', re.MULTILINE)


def is_complete(command: str, line: PrintedLine) -> bool:
    """Whether it runs as printed: no placeholder, no synopsis, no mere name in running text."""
    unquoted = re.sub(r"'[^']*'|\"[^\"]*\"", "", without_comment(command))
    if PLACEHOLDER.search(unquoted) or SYNOPSIS.search(unquoted):
        return False
    words = words_of(command)
    program: Any = PROGRAMS[words[0]]
    context = program.context_class(program, info_name=words[0])
    rest = words[1:]
    while hasattr(program, "get_command") and rest and not rest[0].startswith("-"):
        _, program, rest = program.resolve_command(context, rest)
        context = program.context_class(program, info_name=program.name, parent=context)
    if not rest and (hasattr(program, "get_command") or (line.inline and not line.is_cell)):
        return False
    if "--help" in rest or (rest and not rest[0].startswith("-")) or not line.inline:
        return True
    try:
        program.make_context(program.name, list(rest))
    except Exception:  # typer has its own copy of click's errors; an option alone is named, not used
        return False
    return True


def without_comment(command: str) -> str:
    """The command in the spelling of `EXCEPTIONS`."""
    return command.partition(" #")[0].strip()


def complete_commands(line: PrintedLine) -> list[str]:
    """The complete commands of a line, without comments."""
    return [without_comment(command) for command in line.commands() if is_complete(command, line)]


def runnable_lines(page: Path) -> list[PrintedLine]:
    """What is run of a page: lines whose commands all run here, and the folders that blocks make."""
    lines = []
    for line in printed_lines(page.read_text(encoding="utf-8")):
        complete = complete_commands(line)
        runs = complete and len(complete) == len(line.commands()) and not set(complete) & set(EXCEPTIONS)
        if line.text.startswith("mkdir ") or runs:
            lines.append(line)
    return lines


RUN_PAGES = [
    page
    for page in PAGES
    if not {*DECIDED} & {*page.parts} and any(line.commands() for line in runnable_lines(page))
]

QUICK = (
    *("ask-questions", "blink-engine", "check-a-paper", "check-participants", "erase-a-person"),
    *("export-data", "lab-study", "order-and-counterbalance"),
)
"""Pages that `make test` runs too; they take a few seconds each."""


def page_name(page: Path) -> str:
    """The page from the repository's root."""
    return page.relative_to(REPOSITORY).as_posix()


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of the names that pages use, and a data folder with two studies; pages get copies.

    The processes of a run share them: the first that comes makes them.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "pages_inputs"
    with file_lock(lock_of(folder)):
        if not folder.exists():
            unfinished = folder.with_suffix(".part")
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.mkdir()
            write_inputs(unfinished)
            run_or_fail("server study add lids.toml --clips my-clips --open", unfinished)
            run_or_fail("server study add exp3 --clips out/exp3 --open", unfinished)
            take_part(unfinished, "lids", 8)
            take_part(unfinished, "exp3", 2, recruiter_id="5a9d0c2f", answers=False)
            unfinished.rename(folder)
    return folder


def lock_of(inputs: Path) -> Path:
    """The lock file of the inputs."""
    return inputs.with_suffix(".lock")


def make_named_files(text: str, inputs: Path) -> None:
    """Files of `RECIPES` that a page names, and those that their recipes name."""
    recipes = []
    for file, recipe in reversed(RECIPES.items()):
        if re.search(rf"(?<![\w/-]){re.escape(file)}\b", text):
            text += f"\n{recipe}"
            recipes.append((file, recipe))
    for file, recipe in reversed(recipes):
        if not (inputs / file).exists():
            run_step(recipe, inputs)


def run_step(step: Step, folder: Path) -> None:
    """Prepare something for a page by a command or a function."""
    if isinstance(step, str):
        run_or_fail(step, folder)
    else:
        step(folder)


def run_or_fail(command: str, folder: Path) -> None:
    """Run what prepares a page."""
    done = run_shell(command, folder)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"


def run_shell(text: str, folder: Path, answers: str = "") -> subprocess.CompletedProcess[str]:
    """As a reader would: the programs on the PATH, a data folder in the folder."""
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text],
        cwd=folder,
        env=environment_of(folder),
        capture_output=True,
        text=True,
        check=False,
        input=answers,
        timeout=LIMIT_S,
    )


def environment_of(folder: Path) -> dict[str, str]:
    """The programs of this environment, a home and a data folder in the folder, and no browser."""
    environment = {name: value for name, value in os.environ.items() if name != "DATABASE_URL"}
    cache = environment.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return environment | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}",
        "PALPEBRA_DATA_FOLDER": str(folder / "data"),
        "HOME": str(folder),
        "XDG_CACHE_HOME": cache,
        "BROWSER": "none",
    }


def fault_of_server(line: str, folder: Path) -> str:
    """Start what serves until it is stopped, on a free port, and stop it with Ctrl-C once it answers."""
    port = free_port()
    text = f"{re.sub(r' --port [0-9]+', '', without_comment(line))} --port {port}"
    log = folder / "server.log"
    with log.open("w", encoding="utf-8") as output:
        server = subprocess.Popen(
            ["bash", "-c", f"exec {text}"],
            cwd=folder,
            env=environment_of(folder),
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        answered = _answers(port, server)
        server.send_signal(signal.SIGINT)
        code = server.wait(timeout=60)
    finally:
        server.kill()
    said = log.read_text(encoding="utf-8")
    return (
        "" if answered and code in (0, -signal.SIGINT, 130) else f"answered: {answered}, code {code}: {said}"
    )


def _answers(port: int, server: subprocess.Popen[bytes]) -> bool:
    """Whether the server answers within a minute."""
    until = time.monotonic() + 60
    while time.monotonic() < until and server.poll() is None:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5) as answer:
                return bool(answer.status == 200)
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    return False


@pytest.mark.parametrize("page", [page for page in RUN_PAGES if page.stem not in QUICK], ids=page_name)
def test_commands_of_page_run(page: Path, inputs: Path, tmp_path: Path) -> None:
    check_page(page, inputs, tmp_path)


@pytest.mark.parametrize("page", [page for page in RUN_PAGES if page.stem in QUICK], ids=page_name)
def test_commands_of_quick_page_run(page: Path, inputs: Path, tmp_path: Path) -> None:
    check_page(page, inputs, tmp_path)


def check_page(page: Path, inputs: Path, tmp_path: Path) -> None:
    """Run the lines of a page in a copy of the inputs; fail with line and output of each that fails."""
    lines = runnable_lines(page)
    commands = [command for line in lines for command in complete_commands(line)]
    prepared = [step for command in commands if isinstance(step := BEFORE.get(command), str)]
    folder = tmp_path / "page"
    with file_lock(lock_of(inputs)):
        make_named_files("\n".join([line.text for line in lines] + prepared), inputs)
        shutil.copytree(inputs, folder)
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block[1] == "toml" and (name := MADE_FILE.match(block[2])):
            (folder / f"{name[1]}.toml").write_text(block[2], encoding="utf-8")
    faults = [
        f"{page_name(page)}:{line.line}: {line.text}\n{fault}"
        for line in lines
        if (fault := fault_of_line(line, folder))
    ]
    if faults:
        pytest.fail("\n".join(faults), pytrace=False)


def fault_of_line(line: PrintedLine, folder: Path) -> str:
    """The output of a line that fails; empty if it runs."""
    commands = complete_commands(line)
    for command in commands:
        if step := BEFORE.get(command):
            run_step(step, folder)
    if any(SERVES.fullmatch(command) for command in commands):
        return fault_of_server(line.text, folder)
    done = run_shell(line.text, folder, "".join(ANSWERS.get(command, "") for command in commands))
    expected = 1 if set(commands) & set(ENDS_WITH_1) else 0
    return "" if done.returncode == expected else f"{done.stdout[-500:]}{done.stderr[-1500:]}"


def test_exceptions_are_printed_and_few() -> None:
    pages = [page for page in PAGES if not set(DECIDED) & set(page.parts)]
    printed = [
        command
        for page in pages
        for line in printed_lines(page.read_text(encoding="utf-8"))
        for command in complete_commands(line)
    ]
    assert {*EXCEPTIONS, *ENDS_WITH_1, *BEFORE, *ANSWERS} <= set(printed)
    assert len([command for command in printed if command not in EXCEPTIONS]) > 180
