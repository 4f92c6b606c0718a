"""The experimenter's side under much data: export of a million rows, the monitor with 500 runs x 400 trials.

    python -m bench.experimenter [rows, default 1000000]
    python -m bench.experimenter ROWS postgres

Real servers on SQLite, or the pages and exports alone on a separate PostgreSQL. Prints one table; the
monitor's page is opened in Chromium where there is one.
"""

import csv
import io
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
import uuid
from datetime import timedelta
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright
from sqlalchemy import Insert, func, insert, literal_column, select, text
from sqlalchemy.orm import DeclarativeBase

from bench.harness import peak_mb, print_line
from bench.servers import load_database
from server.accounts import invitations
from server.cli_common import migrated_services
from server.context import Services
from server.core.values import now
from server.models import (
    AssignedTrial,
    Link,
    Rating,
    RunTally,
    Study,
    StudyRun,
    StudyVersion,
    TrialClip,
    VersionClip,
)
from server.participation.tally_pools import Recount
from tests.browser.conftest import CHROMIUM_FLAGS, CHROMIUM_NAMES
from tests.browser.server_process import ServerProcess
from tests.helpers.admins import PASSWORD
from tests.helpers.studies import SHORT, StudyInDatabase


def add_runs(services: Services, study: StudyInDatabase, runs: int, trials: int) -> None:
    """Complete runs with `trials` rated trials each: one in twenty flagged, every drawn frame logged.

    One run is made, the database copies its trials for the others: a million take seconds.
    """
    with services.database.read() as session:
        version_query = select(StudyVersion).join(Study, Study.id == StudyVersion.study_id)
        version = session.scalars(version_query.where(Study.name == study.name)).one()
        clips = list(session.execute(select(VersionClip.id, VersionClip.clip_sha256)))
        link = session.scalars(select(Link.id)).first()
        first = (session.scalar(select(func.max(StudyRun.id))) or 0) + 1
    version_ids = {"study_id": version.study_id, "version_id": version.id, "link_id": link}
    with services.database.write() as session:
        session.execute(
            insert(StudyRun), [_run_row(first + more, trials) | version_ids for more in range(runs)]
        )
        session.execute(insert(AssignedTrial), [_assigned_row(first, trial) for trial in range(trials)])
        session.execute(insert(TrialClip), [_clip_row(first, trial, clips) for trial in range(trials)])
        session.execute(insert(Rating), [_rating_row(first, trial, clips) for trial in range(trials)])
        counted = Recount(services.versions).counted(session, [first])[first]
        session.execute(insert(RunTally).values(study_run_id=first, **counted.values()))
        session.execute(_copied(RunTally, first))
        session.execute(_copied(AssignedTrial, first))
        session.execute(_copied(TrialClip, first))
        session.execute(_copied(Rating, first))


def _copied(table: type[DeclarativeBase], template: int) -> Insert:
    """The template run's rows once for every run after it."""
    names = [column.name for column in table.__table__.columns if column.name not in ("id", "study_run_id")]
    columns = [literal_column(f"{table.__tablename__}.{name}") for name in names]
    rows = select(StudyRun.id, *columns).select_from(StudyRun).join(table, table.study_run_id == template)  # type: ignore[attr-defined]
    return insert(table).from_select(["study_run_id", *names], rows.where(StudyRun.id > template))


def _run_row(number: int, trials: int) -> dict[str, Any]:
    moment = now()
    return {
        "id": number,
        "public_id": f"run{number:08d}",
        "client_id": str(number),
        "token_hash": f"{number:064d}",
        "participant": f"p{number}",
        "phase": "live",
        "origin": "simulated",
        "status": "complete",
        "stage": "done",
        "language": "en",
        "seed": number,
        "slot": number,
        "trials_total": trials,
        "trials_answered": trials,
        "started_at": moment - timedelta(minutes=30),
        "last_seen_at": moment,
        "completed_at": moment,
    }


def _assigned_row(run: int, trial: int) -> dict[str, Any]:
    return {
        "study_run_id": run,
        "trial_index": trial,
        "kind": "main",
        "block": 1,
        "block_label": "all",
        "expected_response": None,
    }


def _clip_row(run: int, trial: int, clips: list[Any]) -> dict[str, Any]:
    clip = clips[trial % len(clips)].id
    return {
        "study_run_id": run,
        "trial_index": trial,
        "role": "shown",
        "position": 0,
        "version_clip_id": clip,
    }


def _rating_row(run: int, trial: int, clips: list[Any]) -> dict[str, Any]:
    flagged = trial % 20 == 0
    return {
        "rating_id": str(uuid.UUID(int=trial)),
        "study_run_id": run,
        "trial_index": trial,
        "play": 1,
        "kind": "clip_rating",
        "payload": {"response": 1 + trial % 7},
        "rt": 640.5 + trial,
        "rt_from_first_frame": 2100.25 + trial,
        "time_elapsed": 6000.0 * (trial + 1),
        "method": "webcodecs",
        "clip_sha256": clips[trial % len(clips)].clip_sha256,
        "key_to_first_frame_ms": 9.5,
        "frames_drawn": 45,
        "frames_late": int(flagged),
        "frames_missing": int(flagged),
        "longest_gap_ms": 34.1,
        "stalls": 0,
        "focus_lost": False,
        "refresh_rate_hz": 60.0,
        "device_pixel_ratio": 2.0,
        "px_per_mm": 3.78,
        "verdict": "flagged" if flagged else "good",
        "verdict_rule": "flagged_missing_frames" if flagged else "",
        "drawn": [[frame, round(10 + 33.3 * frame, 1)] for frame in range(45)],
        "saved_at": now(),
    }


TRIALS = 400
RUNS = 500
EXPORT_AIM = "> 60,000"
UPDATES = 10
CHANGED = 100
STUDY = "/api/admin/studies/short"


def filled(folder: Path, runs: int, trials: int = TRIALS, database: str = "") -> ServerProcess:
    """A server's data folder with the short study and that many complete runs."""
    process = ServerProcess(folder / "data", database_url=database)
    study = process.add_study(folder / "clips", SHORT)
    begun = time.monotonic()
    with migrated_services(process.settings) as services:
        add_runs(services, study, runs, trials)
        if database:  # as its own housekeeping does within a minute
            with services.database.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as one:
                one.execute(text("VACUUM ANALYZE"))
    print_line(f"filling the database with {runs * trials:,} ratings", f"{time.monotonic() - begun:.1f} s")
    return process


def owner_link(process: ServerProcess) -> str:
    with migrated_services(process.settings) as services:
        return invitations.invite(services.database, "owner", "", None)[1]


class Owner:
    """A signed-in owner without a browser."""

    def __init__(self, process: ServerProcess, name: str = "ada") -> None:
        self.address = process.address
        self.cookie = ""
        body = f'{{"name": "{name}", "password": "{PASSWORD}"}}'.encode()
        answer = self.open(f"/api/admin/invitations/{owner_link(process)}/account", body)
        self.cookie = answer.headers["set-cookie"].partition(";")[0]

    def open(self, path: str, body: bytes | None = None):  # type: ignore[no-untyped-def]
        headers = {"cookie": self.cookie, "origin": self.address, "content-type": "application/json"}
        return urllib.request.urlopen(urllib.request.Request(self.address + path, body, headers))

    def time_of(self, path: str, body: bytes | None = None) -> tuple[float, int]:
        """Seconds and lines of a download; nothing of it is kept."""
        begun, lines = time.monotonic(), 0
        with self.open(path, body) as answer:
            while piece := answer.read(1 << 20):
                lines += piece.count(b"\n")
        return time.monotonic() - begun, lines


def export(folder: Path, rows: int, database: str = "") -> None:
    process = filled(folder, max(1, rows // TRIALS), database=database).start()
    try:
        owner = Owner(process)
        assert process.process is not None
        before = peak_mb(process.process.pid)
        baseline = plainly_written(process)
        print_line("the view's rows selected and written as CSV, rows a second", f"{rows / baseline:,.0f}")
        for file, must in (("ratings.csv", EXPORT_AIM), ("psych-ds.zip", "")):
            seconds, _ = owner.time_of(f"{STUDY}/data/{file}?origin=all")
            print_line(f"{file} over HTTP, rows a second", f"{rows / seconds:,.0f}", must)
            print_line("its time against the baseline's", f"{seconds / baseline:.2f}")
        print_line(
            "peak memory of the server, before and after",
            f"{before:.0f}, {peak_mb(process.process.pid):.0f} MB",
        )
    finally:
        process.stop()
    command_line(process, folder, rows)


def plainly_written(process: ServerProcess) -> float:
    """Seconds that a program takes which only selects the view and writes its rows: an export's baseline."""
    begun = time.monotonic()
    with migrated_services(process.settings) as services, services.database.read() as session:
        rows = session.connection().execute(text("SELECT * FROM ratings")).cursor
        while some := rows.fetchmany(500):
            csv.writer(io.StringIO(), lineterminator="\n").writerows(some)
    return time.monotonic() - begun


LINKS = 5_000
RATED_RUNS, MANY_RUNS = 6_000, 100_000


def pages(folder: Path, rows: int, database: str = "") -> None:
    """The pages of a study with very many ratings, links and runs, each asked for by itself."""
    process = filled(folder, RATED_RUNS, max(1, rows // RATED_RUNS), database)
    try:
        shown(process.start(), f"{RATED_RUNS:,} runs", "ada")
        process.stop()
        more_runs(process, MANY_RUNS)
        shown(process.start(), f"{MANY_RUNS:,} runs", "grace")
    finally:
        process.stop()


def shown(process: ServerProcess, what: str, name: str) -> None:
    """Every page of a server that has just been started, first and later."""
    owner = Owner(process, name)
    made = owner.time_of(f"{STUDY}/links", f'{{"kind": "personal", "count": {LINKS}}}'.encode())[0]
    print_line(f"{what}: making {LINKS} links", f"{1000 * made:.0f} ms")
    for name, path in (
        ("results", "results?origin=simulated"),
        ("monitor", "monitor"),
        ("links, a page", "links"),
        ("participants, a page", "runs"),
        ("participants, searched", "runs?search=p77"),
    ):
        first, *later = (owner.time_of(f"{STUDY}/{path}")[0] for _ in range(6))
        spent = f"{1000 * first:.0f}, {1000 * statistics.median(later):.0f} ms"
        print_line(f"{what}: {name}, first, median of 5 later", spent, "< 300 ms")


def more_runs(process: ServerProcess, total: int) -> None:
    """Runs without a rating, so that there are `total`."""
    with migrated_services(process.settings) as services, services.database.write() as session:
        names = [column.name for column in StudyRun.__table__.columns]
        own = {"id": "id + i", "public_id": "'m' || i", "client_id": "'m' || i", "token_hash": "'m' || i"}
        values = ", ".join(own.get(name, name) for name in names)
        series = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < :more)"
        there = session.execute(text("SELECT count(*) FROM study_runs")).scalar_one()
        one = "(SELECT * FROM study_runs ORDER BY id DESC LIMIT 1) AS one"
        statement = f"INSERT INTO study_runs ({', '.join(names)}) {series} SELECT {values} FROM {one}, n"
        session.execute(text(statement), {"more": total - there})


def command_line(process: ServerProcess, folder: Path, rows: int) -> None:
    environment = {
        "PALPEBRA_DATA_FOLDER": str(process.settings.data_folder),
        "PALPEBRA_SECRET_KEY": process.settings.secret_key,
        "DATABASE_URL": process.settings.database_url,
    }
    begun, out = time.monotonic(), folder / "short.csv"
    command = [sys.executable, "-m", "server", "export", "short", "--origin", "all", "--out", str(out)]
    running = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(running.pid, 0)
    seconds, peak = time.monotonic() - begun, used.ru_maxrss / 1024
    assert status == 0
    with out.open(encoding="utf-8") as stream:
        assert sum(1 for _ in stream) == rows + 1
    print_line("`server export`, rows a second, start included", f"{rows / seconds:,.0f}", EXPORT_AIM)
    spent = used.ru_utime + used.ru_stime
    print_line("the same for its processor time", f"{rows / spent:,.0f}", EXPORT_AIM)
    print_line("its peak memory", f"{peak:.0f} MB")


def monitor(folder: Path) -> None:
    process = filled(folder, RUNS).start()
    try:
        owner = Owner(process)
        first, _ = owner.time_of(f"{STUDY}/monitor?origin=simulated")
        later = [owner.time_of(f"{STUDY}/monitor?origin=simulated")[0] for _ in range(20)]
        print_line(f"monitor, {RUNS} runs x {TRIALS} trials: first answer", f"{1000 * first:.0f} ms")
        print_line("every later one, median of 20", f"{1000 * statistics.median(later):.0f} ms", "< 200 ms")
        page(process)
    finally:
        process.stop()


def page(process: ServerProcess) -> None:
    """Chromium's work for one update, while a fifth of the runs change."""
    chromium = next((path for name in CHROMIUM_NAMES if (path := shutil.which(name))), None)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        shown = browser.new_page(viewport={"width": 1280, "height": 800})
        shown.goto(f"{process.address}/admin/invitation#{owner_link(process)}")
        shown.get_by_label("User name").fill("grace")
        shown.locator("input[autocomplete=new-password]").fill(PASSWORD)
        shown.get_by_role("button", name="Create account").click()
        shown.get_by_role("heading", name="Studies").wait_for()
        shown.goto(f"{process.address}/admin/studies/short/monitor")
        # The database is filled with simulated runs; the page begins with those of participants.
        shown.get_by_text("Simulated", exact=True).click()
        shown.locator("canvas").nth(RUNS - 1).wait_for(timeout=60_000)
        work = shown.context.new_cdp_session(shown)
        work.send("Performance.enable")
        shown.evaluate(
            "window.long = []; new PerformanceObserver((all) => window.long.push(...all.getEntries()"
            ".map((one) => one.duration))).observe({ entryTypes: ['longtask'] })"
        )
        before = metrics(work)
        for number in range(UPDATES):
            change(process, number)
            shown.wait_for_timeout(2000)
        after = metrics(work)
        for name in ("ScriptDuration", "TaskDuration"):
            print_line(f"page, {name} an update", f"{1000 * (after[name] - before[name]) / UPDATES:.0f} ms")
        longest = max(shown.evaluate("window.long"), default=0)
        print_line("page, longest task (frames are late above 50 ms)", f"{longest:.0f} ms")
        browser.close()


def metrics(work) -> dict[str, float]:  # type: ignore[no-untyped-def]
    return {one["name"]: one["value"] for one in work.send("Performance.getMetrics")["metrics"]}


def change(process: ServerProcess, number: int) -> None:
    """As if a fifth of the people had just been seen, in another stage than before."""
    stage = ("trials", "practice")[number % 2]
    with migrated_services(process.settings) as services, services.database.write() as session:
        statement = (
            "UPDATE study_runs SET status = 'active', stage = :stage, last_seen_at = :now WHERE id <= :most"
        )
        moment = time.strftime("%Y-%m-%d %H:%M:%S.000000", time.gmtime())
        session.execute(text(statement), {"stage": stage, "now": moment, "most": CHANGED})


def on_postgres(rows: int) -> None:
    """The pages and exports, each on a separate database."""
    for measure in (pages, export):
        with tempfile.TemporaryDirectory() as folder, load_database("postgres", Path(folder)) as database:
            measure(Path(folder), rows, database.url)


def main() -> None:
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    if sys.argv[2:] == ["postgres"]:
        on_postgres(rows)
        return
    for measure in (monitor, lambda folder: pages(folder, rows), lambda folder: export(folder, rows)):
        with tempfile.TemporaryDirectory() as folder:
            measure(Path(folder))


if __name__ == "__main__":
    main()
