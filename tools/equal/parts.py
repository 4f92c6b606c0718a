"""The outputs that are compared, by part: each function writes a side's files into a folder.

Every part takes its inputs (golden databases, recordings, options) from the working tree, so that both sides
get the same. A part that writes nothing, or an empty file, is an error: see `compare.py`.
"""

from __future__ import annotations

import gzip
import http.cookiejar
import json
import re
import sqlite3
import tempfile
import urllib.error
import urllib.request
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tools.equal.sides import ROOT, PartError, Side, command

DATABASES = ROOT / "tests" / "golden" / "databases"
SHARED = ROOT.parent / "shared" / "data"
KEY_OF_OLD, KEY = "browser tests", "the golden databases of the tests, a key"
"""Secret keys of the golden databases: of 0001, and of every later one."""
FORMATS = {
    "csv": "csv",
    "wide": "csv",
    "runs": "csv",
    "raw": "ndjson",
    "codebook": "md",
    "columns": "json",
    "psych-ds": "zip",
}
ACCOUNT = {"name": "harness", "password": "correct horse battery"}
LEFT_OUT = ("/monitor/stream", "/data/", "/links/signing", "/comparison")
"""GET addresses of a study that are not fetched: one never ends, exports hold some, two need parameters."""
CLIP_OPTIONS = (
    ("--amplitude", "natural", "--no-blur"),
    ("--profile", "real", "--exemplar", "3"),
    ("--lower-lid", "both"),
    ("--fps", "60", "--duration-ms", "400"),
    ("--eyes", "separate", "--profile", "real", "--brow-mm", "1", "--gaze-mm", "1"),
)
CLIPS = 12
CHARACTER = re.compile(r"(\S+) +(\d+) x (\d+) px")
"""A line of `stimuli character list` about a character that is here: name, width, height."""


def help_texts(side: Side, out: Path) -> None:
    """`--help` of every program, command and sub-command."""
    side.run({"help": str(out)})


def declaration(side: Side, out: Path) -> None:
    """JSON schema of a declaration; plain form and hash of every shipped and golden one."""
    side.probe("declaration", out)


def assignments(side: Side, out: Path) -> None:
    """Trials of the first 200 places of every shipped example."""
    side.probe("assignments", out)


def clip_inputs(side: Side, out: Path) -> None:
    """Input hash of every clip of every shipped example."""
    side.probe("clip_inputs", out)


def golden_names() -> list[str]:
    """Revisions of the golden databases."""
    names = sorted(path.name.removesuffix(".sqlite.gz") for path in DATABASES.glob("*.sqlite.gz"))
    if not names:
        raise PartError(f"expected golden databases in {DATABASES}, there are none")
    return names


@contextmanager
def upgraded_database(side: Side, name: str) -> Iterator[tuple[dict[str, str], list[str]]]:
    """A golden database, upgraded by a side's program: environment for its server, names of its studies."""
    with tempfile.TemporaryDirectory(prefix="equal-data-") as folder:
        file = Path(folder) / "palpebra.sqlite"
        file.write_bytes(gzip.decompress((DATABASES / f"{name}.sqlite.gz").read_bytes()))
        with sqlite3.connect(file) as connection:
            studies = [row[0] for row in connection.execute("SELECT name FROM studies ORDER BY name")]
        connection.close()
        key = KEY_OF_OLD if name == "0001" else KEY
        environment = {"PALPEBRA_DATA_FOLDER": folder, "PALPEBRA_SECRET_KEY": key}
        side.commands(command("server", "database", "upgrade"), **environment)
        yield environment, studies


def exports(side: Side, out: Path) -> None:
    """Every table of every study of every golden database, upgraded; Methods paragraphs."""
    for name in golden_names():
        with upgraded_database(side, name) as (environment, studies):
            jobs = [command("server", "study", "list", out=out / name / "studies.txt")]
            for study in studies:
                folder = out / name / study
                folder.mkdir(parents=True)
                for form, ending in FORMATS.items():
                    options = () if form in ("codebook", "columns") else ("--origin", "all")
                    file = folder / f"{form}.{ending}"
                    if form == "psych-ds":
                        options = ("--origin", "participant")
                    arguments = ("--format", form, *options, "--out", file)
                    refusal = folder / f"{form}.refused.txt"  # as of a wide table of comparisons
                    jobs.append(command("server", "export", study, *arguments, refusal=refusal))
            side.commands(*jobs, **environment)
    unpack_archives(out)


def pages_data(side: Side, out: Path) -> None:
    """OpenAPI; what an experimenter's pages read of every study of every golden database, by HTTP."""
    for name in golden_names():
        with upgraded_database(side, name) as (environment, studies):
            side.commands(
                command("server", "admin", "create", ACCOUNT["name"], "--password", ACCOUNT["password"]),
                **environment,
            )
            with side.server(**environment) as address:
                browser = Browser(address)
                openapi = browser.read("/api/openapi.json")
                write_bytes(out / "openapi.json", openapi)
                browser.sign_in()
                for study in studies:
                    fetch_study(browser, json.loads(openapi), study, out / name / study)


class Browser:
    """A signed-in experimenter's requests."""

    def __init__(self, address: str) -> None:
        self.address = address
        cookies = urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
        self.opener = urllib.request.build_opener(cookies)

    def sign_in(self) -> None:
        """Begin a session of the golden account."""
        self.read("/api/admin/session", json.dumps(ACCOUNT).encode())

    def read(self, path: str, body: bytes | None = None) -> bytes:
        """The answer to a GET, or to a POST of this body; a refusal of a GET is an answer, too."""
        headers = {"Content-Type": "application/json", "Sec-Fetch-Site": "same-origin"}
        request = urllib.request.Request(self.address + path, data=body, headers=headers)
        try:
            with self.opener.open(request, timeout=60) as answer:
                return bytes(answer.read()) or f"{answer.status}\n".encode()
        except urllib.error.HTTPError as refused:
            if body is not None:
                raise PartError(f"{path}: {refused.code} {refused.read()[:500]!r}") from refused
            return f"{refused.code} ".encode() + refused.read()


def fetch_study(browser: Browser, openapi: dict[str, Any], study: str, out: Path) -> None:
    """Every address of a study that takes no other parameter; every run, and its replay."""
    prefix = "/api/admin/studies/{study}"
    for path, methods in sorted(openapi["paths"].items()):
        rest = path.removeprefix(prefix)
        if "get" not in methods or rest == path or "{" in rest or rest.startswith(LEFT_OUT):
            continue
        where = prefix.replace("{study}", study) + rest
        name = rest.strip("/").replace("/", ".") or "study"
        write_bytes(out / (name if name.endswith((".csv", ".txt")) else f"{name}.json"), browser.read(where))
    where = prefix.replace("{study}", study) + "/runs"
    listed = json.loads(browser.read(f"{where}?simulated=true&limit=100"))
    write_json(out / "runs-all.json", listed)
    rows = next(value for value in listed.values() if isinstance(value, list))
    for number, row in enumerate(rows):
        run = str(row["run"])
        for ending in ("", "/replay", "/replay/trials/0", "/subject-access"):
            name = f"run-{number}{ending.replace('/', '.')}.json"
            write_bytes(out / "runs" / name, browser.read(f"{where}/{run}{ending}"))


def reports(side: Side, out: Path) -> None:
    """Synthetic ratings of exp1 to exp3, and the report on them in every form."""
    jobs = []
    for name in ("exp1", "exp2", "exp3"):
        ratings = out / name / "ratings.csv"
        ratings.parent.mkdir(parents=True)
        jobs.append(command("analysis", "synthesise", name, "--seed", 5, "--out", ratings))
        options = ("--csv", ratings, "--out", out / name / "report", "--json", out / name / "numbers.json")
        # What takes long (mixed models, Bayes factors) is compared on the smallest of the three.
        slow = "--sensitivity" if name == "exp3" else "--no-sensitivity"
        jobs.append(command("analysis", "run", name, *options, slow, out=out / name / "printed.txt"))
    side.commands(*jobs)
    unpack_archives(out)


def clips(side: Side, out: Path) -> None:
    """Twelve clips: every character that is here, then some options on them in turn."""
    with tempfile.TemporaryDirectory(prefix="equal-") as folder:
        listed = Path(folder) / "characters.txt"
        side.commands(command("stimuli", "character", "list", out=listed))
        lines = listed.read_text(encoding="utf-8").splitlines()
    characters = [known.groups() for line in lines if (known := CHARACTER.match(line))]
    out.mkdir(parents=True)
    jobs = []
    for number in range(CLIPS):
        character, *size_px = characters[number % len(characters)]
        at = number - len(characters)
        options = CLIP_OPTIONS[at % len(CLIP_OPTIONS)] if at >= 0 else ()
        words = "-".join(one.strip("-") for one in options) or "plain"
        file = out / f"{number:02d}-{character}-{words}.mp4"
        sized = ("--character", character, "--size", "x".join(size_px))
        jobs.append(command("stimuli", "clip", *sized, *options, "--out", file))
    side.commands(*jobs)


def recordings(side: Side, out: Path) -> None:
    """Track and blink tables: of the synthetic actor, and of the shared recordings where they are here."""
    out.mkdir(parents=True)
    video, labels, track = out / "actor.mp4", out / "actor.labels.json", out / "actor.track.csv"
    made = (
        "--seconds",
        2,
        "--seed",
        3,
        "--out",
        video,
        "--truth",
        out / "actor.truth.csv",
        "--labels",
        labels,
    )
    jobs = [
        command("stimuli", "actor", *made),
        command("stimuli", "track", video, "--labels", labels, "--out", track),
        *blink_jobs(track, out / "actor"),
    ]
    series = ROOT / "stimuli_builder" / "blinks" / "library" / "eyeloop_track.csv"
    if series.is_file():
        jobs += blink_jobs(series, out / "eyeloop")
    if SHARED.is_dir():
        file = SHARED / "blink_series" / "espbm_sample_ear_short.csv"
        jobs += blink_jobs(file, out / "espbm", "--column", "EAR_l", "--column", "EAR_r", "--fps", 240)
        face = SHARED / "face_video" / "single_face"
        table = out / "single_face.track.csv"
        labelled = face.with_name(f"{face.name}.points.json")
        jobs.append(command("stimuli", "track", f"{face}.mp4", "--labels", labelled, "--out", table))
        jobs += blink_jobs(table, out / "single_face")
    side.commands(*jobs)


def blink_jobs(series: Path, out: Path, *options: object) -> list[dict[str, Any]]:
    """Blinks of a series by the classifier, with every table that it writes, and by the paper's rule."""
    tables = ("--out", f"{out}.blinks.csv", "--summary", f"{out}.summary.json", "--report", f"{out}.html")
    by_rule = ("--preset", "velocity", "--out", f"{out}.velocity.csv")
    return [
        command("stimuli", "blinks", series, *options, *tables),
        command("stimuli", "blinks", series, *options, *by_rule),
    ]


def unpack_archives(folder: Path) -> None:
    """Replace each zip and Word file by a folder of what is in it: an archive also holds times."""
    for path in [*folder.rglob("*.zip"), *folder.rglob("*.docx")]:
        into = path.with_name(path.name + ".d")
        with zipfile.ZipFile(path) as archive:
            archive.extractall(into)
        path.unlink()
        for empty in [file for file in into.rglob("*") if file.is_file() and not file.stat().st_size]:
            # Some members are empty by design (.gitkeep); that they are there is still compared.
            empty.write_text("(empty)\n", encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """A value as JSON, one line per leaf."""
    text = json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """A file in a folder that is made; JSON gets one line per leaf, so that a difference is one line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".json" and re.match(rb"\s*[\[{]", content):
        value = json.loads(content)
        content = (json.dumps(value, indent=1, ensure_ascii=False) + "\n").encode()
    path.write_bytes(content)


Part = Callable[[Side, Path], None]
PARTS: dict[str, Part] = {
    "help": help_texts,
    "declaration": declaration,
    "assignments": assignments,
    "clip_inputs": clip_inputs,
    "exports": exports,
    "http": pages_data,
    "reports": reports,
    "clips": clips,
    "recordings": recordings,
}
