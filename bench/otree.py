"""oTree, the most used open platform for such studies, under the same load: in a separate environment."""

from __future__ import annotations

import asyncio
import json
import os
import random
import subprocess
import sys
import tempfile
import time
import urllib.request
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from bench.harness import ROOT, Row, cpu_s_of, percentile, quantiles, with_children
from bench.raters import EVERY_S, Connection, Tally, rated, run
from bench.servers import load_server
from tests.helpers.ports import free_port

VERSION = "6.0.15"
ENVIRONMENT = ROOT / "build" / "otree"
START_S, INSTALL_S = 60.0, 300.0
SETTINGS = """
SESSION_CONFIGS = [dict(name="ratings", app_sequence=["ratings"], num_demo_participants=1)]
SESSION_CONFIG_DEFAULTS = dict(real_world_currency_per_point=1, participation_fee=0)
LANGUAGE_CODE, REAL_WORLD_CURRENCY_CODE, USE_POINTS = "en", "EUR", False
SECRET_KEY = "load test"
"""
APP = """
from otree.api import *
class C(BaseConstants):
    NAME_IN_URL, PLAYERS_PER_GROUP, NUM_ROUNDS = "ratings", None, 60
class Subsession(BaseSubsession):
    pass
class Group(BaseGroup):
    pass
class Player(BasePlayer):
    rating = models.IntegerField(min=1, max=7)
class Rate(Page):
    form_model, form_fields = "player", ["rating"]
page_sequence = [Rate]
"""
PAGE = "{{ block title }}Rate{{ endblock }}{{ block content }}{{ formfields }}{{ next_button }}{{ endblock }}"


class UnavailableError(Exception):
    """oTree cannot be tried here; the message says why."""


@dataclass(frozen=True)
class OTree:
    """A running oTree with a session of so many participants."""

    port: int
    participants: list[str]
    process: psutil.Process

    def cpu_s(self) -> float:
        """Processor time of all its processes so far."""
        return cpu_s_of(with_children(self.process.pid))


@contextmanager
def otree(count: int) -> Iterator[OTree]:
    """oTree on SQLite in a separate folder; UnavailableError if it does not install or start."""
    _install()
    with tempfile.TemporaryDirectory(prefix="palpebra-otree-") as name:
        folder, port = Path(name), free_port()
        write_project(folder)
        path = f"{ENVIRONMENT / 'bin'}{os.pathsep}{os.environ['PATH']}"
        environment = {**os.environ, "OTREE_PRODUCTION": "1", "PATH": path}
        program = str(ENVIRONMENT / "bin" / "otree")
        subprocess.run(
            [program, "resetdb", "--noinput"], cwd=folder, env=environment, check=True, capture_output=True
        )
        with (folder / "log").open("wb") as log:
            started = subprocess.Popen(
                [program, "prodserver", str(port)], cwd=folder, env=environment, stdout=log, stderr=log
            )
        try:
            process = psutil.Process(started.pid)
            yield OTree(port, _session(port, count), process)
        finally:
            children = process.children(recursive=True)
            for running in (process, *children):
                with suppress(psutil.NoSuchProcess):
                    running.terminate()
            psutil.wait_procs([process, *children], timeout=10)


def _install() -> None:
    if (ENVIRONMENT / "bin" / "otree").exists():
        return
    try:
        subprocess.run([sys.executable, "-m", "venv", str(ENVIRONMENT)], check=True, capture_output=True)
        pip = [str(ENVIRONMENT / "bin" / "python"), "-m", "pip", "install", "-q", f"otree=={VERSION}"]
        subprocess.run(pip, check=True, capture_output=True, text=True, timeout=INSTALL_S)
    except (OSError, subprocess.SubprocessError) as error:
        said = str(getattr(error, "stderr", "") or error).strip().splitlines()[-1]
        raise UnavailableError(f"oTree {VERSION} does not install here: {said[:90]}") from error


def write_project(folder: Path) -> None:
    """Write the files of a study with one rating per page."""
    for name in ("_static", "_templates", "ratings"):
        (folder / name).mkdir()
    (folder / "settings.py").write_text(SETTINGS)
    (folder / "ratings" / "__init__.py").write_text(APP)
    (folder / "ratings" / "Rate.html").write_text(PAGE)


def _session(port: int, count: int) -> list[str]:
    """Make a session; return its participants' codes."""
    address, ends = f"http://127.0.0.1:{port}/api/sessions", time.monotonic() + START_S
    body = json.dumps({"session_config_name": "ratings", "num_participants": count}).encode()
    while True:
        try:
            request = urllib.request.Request(address, body, {"content-type": "application/json"})
            with urllib.request.urlopen(request, timeout=START_S) as answer:
                code = json.load(answer)["code"]
            with urllib.request.urlopen(f"{address}/{code}", timeout=START_S) as answer:
                return [participant["code"] for participant in json.load(answer)["participants"]]
        except OSError as error:
            if time.monotonic() > ends:
                raise UnavailableError(f"oTree does not start here: {error}") from error
            time.sleep(0.2)


class OTreeRater:
    """Answers a page each few seconds: sends the form, then fetches the next page."""

    def __init__(self, port: int, participant: str, number: int, tally: Tally) -> None:
        self.connection, self.participant, self.tally = Connection(port), participant, tally
        self.rng = random.Random(number)

    async def rate_until(self, end: float, every_s: float) -> None:
        """As `LoadRater.rate_until`."""
        due, page = time.monotonic() + self.rng.uniform(0, every_s), 1
        await self._call("GET", f"/InitializeParticipant/{self.participant}")
        while due < end:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            began, address = time.perf_counter(), f"/p/{self.participant}/ratings/Rate/"
            status = await self._call("POST", f"{address}{page}", b"rating=4")
            self.tally.rating_ms.append(1000 * (time.perf_counter() - began))
            if status == 302:
                self.tally.acknowledged[str(uuid.uuid4())] = 4
            page += 1
            await self._call("GET", f"{address}{page}")
            due += every_s
        self.connection.close()

    async def _call(self, method: str, path: str, body: Any = None) -> int:
        for _ in range(2):  # it closes a connection that is idle for five seconds
            try:
                return (await self.connection.call(method, path, body, keep=False))[0]
            except OSError:
                self.tally.retries += 1
        self.tally.given_up += 1
        return 599


def rated_on_otree(count: int, seconds: float) -> list[Row]:
    """The same number of raters on oTree and here, SQLite both: latency and processor time as ratios."""
    theirs, used = Tally(), []
    try:
        with otree(count) as running:
            raters = [
                OTreeRater(running.port, code, number, theirs)
                for number, code in enumerate(running.participants)
            ]

            async def go() -> None:
                before = running.cpu_s()
                end = time.monotonic() + seconds
                await asyncio.gather(*(rater.rate_until(end, EVERY_S) for rater in raters))
                used.append(running.cpu_s() - before)

            run(go())
    except UnavailableError as reason:
        return [Row(f"{count} raters on oTree", "skipped", str(reason))]
    with load_server("sqlite", 1) as server:
        ours, clocks = rated(server, count, seconds)
    our_cost = clocks.used["server"] / max(1, len(ours.rating_ms))
    their_cost = used[0] / max(1, len(theirs.acknowledged))
    ratio = percentile(theirs.rating_ms, 0.95) / percentile(ours.rating_ms, 0.95)
    name = f"{count} raters on oTree {VERSION} and here, sqlite, {seconds:.0f} s"
    costs = f"{1000 * their_cost:.1f}; {1000 * our_cost:.1f}"
    answers = f"{len(theirs.acknowledged)}; {len(ours.acknowledged)}"
    return [
        Row(name, "answers stored: oTree; here", answers),
        Row("", "oTree: answer p50 / p95 / p99 (ms)", quantiles(theirs.rating_ms, 0.5, 0.95, 0.99)),
        Row("", "here: rating p50 / p95 / p99 (ms)", quantiles(ours.rating_ms, 0.5, 0.95, 0.99)),
        Row("", "p95: oTree's is so many times ours", f"{ratio:.1f}", "> 1", ratio > 1),
        Row("", "CPU per answer: oTree; here, clip included (ms)", costs),
    ]
