"""The command `server` as people call it: arguments, environment, output, exit code."""

import csv
import io
import json
import re
from contextlib import closing
from pathlib import Path

import pytest
from pyrage.x25519 import Identity

from experiments.declaration.clip_rating import SCALE_NAME
from experiments.kinds.clip_rating import RATINGS
from experiments.load import parse_experiment
from experiments.manifest import MADE_ELSEWHERE, UPLOADED
from server.accounts.identity import OPERATOR
from server.context import Services, open_services
from server.core.migrate import current_revision
from server.core.settings import Settings
from server.core.values import now
from server.models import Clip, Link, Study, StudyRun, StudyVersion
from server.participation.tally_pools import pooled_tally
from server.results.repository import Pool
from server.studies.schemas import PlacedClip
from server.studies.series import compare_versions, effects_of_edit
from tests.helpers.databases import BACKENDS, run_server_command
from tests.helpers.motion_checks import checked
from tests.helpers.studies import SHORT, Participant, StudyInDatabase
from tests.helpers.tiny_clips import make_clip_folder


@pytest.fixture
def sources(quick_folder: Path) -> Path:
    """A folder with a declaration and its clips."""
    (quick_folder / "short.toml").write_text(SHORT)
    make_clip_folder(parse_experiment(SHORT), quick_folder / "clips")
    return quick_folder


def add(settings: Settings, sources: Path, *options: str):
    clips = str(sources / "clips")
    return run_server_command(
        settings, "study", "add", str(sources / "short.toml"), "--clips", clips, *options
    )


def test_a_database_without_studies_may_be_the_wrong_one(settings: Settings, services: Services) -> None:
    export = run_server_command(settings, "export", "motion", "--out", "-")
    assert export.returncode == 2
    assert "There is no study 'motion'; this database has no studies. If the server" in export.stderr
    assert export.stderr.endswith("set PALPEBRA_DATA_FOLDER to the one that it printed\n")


def test_a_study_from_files_to_data(settings: Settings, services: Services, sources: Path) -> None:
    added = add(settings, sources, "--open")
    assert added.returncode == 0, added.stderr
    assert re.search(r"http://localhost:8000/run/[\w-]{22}$", added.stdout.strip())
    simulated = run_server_command(settings, "simulate", "short", "--participants", "2", "--seed", "4")
    assert "2 simulated participants" in simulated.stdout, simulated.stderr
    said = " ".join(simulated.stdout.split())
    assert "1% of plays fail and are repeated, 3% are flagged" in said
    assert "by design" in said
    out = sources / "short.csv"
    people = run_server_command(settings, "export", "short", "--out", str(out))
    assert people.returncode == 0, people.stderr
    assert "short.csv: 0 rows, " in people.stdout.replace("\n", "")
    assert "no data of origin participant to export" in people.stderr
    assert "there are runs: 2 of origin simulated (--origin)" in people.stderr
    assert len(out.read_text(encoding="utf-8").splitlines()) == 1
    exported = run_server_command(settings, "export", "short", "--origin", "simulated", "--out", str(out))
    assert exported.returncode == 0, exported.stderr
    rows = list(csv.DictReader(io.StringIO(out.read_text(encoding="utf-8"))))
    assert f"{out.stat().st_size:,} bytes" in exported.stdout.replace("\n", "")
    # A play that failed is offered again and has a separate row.
    assert len({(row["run"], row["trial_index"]) for row in rows if row["verdict"] != "failed"}) == 2 * 12
    assert list(rows[0]) == RATINGS.csv_header(["character", "speed"])
    call = ("export", "short", "--origin", "simulated", "--old-order", "--out", str(out))
    assert run_server_command(settings, *call).returncode == 0
    as_before = list(csv.DictReader(io.StringIO(out.read_text(encoding="utf-8"))))
    assert list(as_before[0]) == RATINGS.in_old_order().csv_header(["character", "speed"])
    assert as_before == rows
    assert {row["synthetic"] for row in rows} == {"1"}
    assert {row["run_status"] for row in rows} == {"complete"}
    with services.database.read() as session:
        assert [run.origin for run in session.query(StudyRun)] == ["simulated"] * 2


def test_adding_again_changes_nothing_and_a_change_makes_a_version(
    settings: Settings, services: Services, sources: Path
) -> None:
    first, again = add(settings, sources, "--open"), add(settings, sources, "--open")
    assert first.stdout.splitlines()[-1] == again.stdout.splitlines()[-1]
    assert "nothing new" in again.stdout
    (sources / "short.toml").write_text(SHORT.replace("Do you agree?", "Do you agree to take part?"))
    changed = add(settings, sources)
    assert "version 2" in changed.stdout, changed.stderr
    assert "another wording" in changed.stdout
    with services.database.read() as session:
        assert session.query(StudyVersion).count() == 2
        assert session.query(Clip).count() == 8
        assert (session.query(Study).one().active_version, session.query(Link).count()) == (2, 1)


def test_another_size_of_the_same_clips_makes_a_version_and_a_series(
    settings: Settings, services: Services, sources: Path
) -> None:
    add(settings, sources)
    manifest = sources / "clips" / "manifest.json"
    told = json.loads(manifest.read_text(encoding="utf-8"))
    told["clips"] = [clip | {"width_mm": 90} for clip in told["clips"]]
    manifest.write_text(json.dumps(told), encoding="utf-8")
    changed = add(settings, sources)
    assert "version 2, 8 clips (0 new)" in changed.stdout, changed.stderr
    assert "nothing new" in add(settings, sources).stdout
    with services.database.read() as session:
        assert [version.series for version in session.query(StudyVersion)] == [1, 2]
        study = session.query(Study).one()
        definition = parse_experiment(SHORT)
        assert effects_of_edit(session, study, definition).series == 2
        study.active_version = 1
        assert effects_of_edit(session, study, definition).series == 1
        # Clips that the builder lists with their cells keep their sizes, too.
        places = [
            PlacedClip(clip_sha256=c.clip_sha256, file=c.file, levels=c.levels, exemplar=c.exemplar)
            for c in study.versions[0].clips
        ]
        assert effects_of_edit(session, study, definition, places).series == 1
        places[0].clip_sha256 = "0" * 64
        assert effects_of_edit(session, study, definition, places).series == 3
        comparison = compare_versions(session, ("short", 1), ("short", 2), OPERATOR)
        assert (comparison.clips, comparison.keys, comparison.pooled) == ([], [], False)


def test_adding_motion_checks_again_changes_nothing(settings: Settings, sources: Path) -> None:
    text = checked(SHORT)
    (sources / "short.toml").write_text(text)
    make_clip_folder(parse_experiment(text), sources / "clips")
    first = add(settings, sources)
    assert "version 1" in first.stdout, first.stderr
    assert "version 1, nothing new" in add(settings, sources).stdout


def test_an_archived_study_is_not_changed_from_the_command_line(
    settings: Settings, services: Services, sources: Path, study: StudyInDatabase
) -> None:
    with services.database.write() as session:
        archived = session.query(Study).one()
        archived.status, archived.archived_at = "closed", now()
    (sources / "short.toml").write_text(SHORT.replace("Do you agree?", "Do you agree to take part?"))
    for refused in (
        add(settings, sources, "--open"),
        run_server_command(settings, "study", "status", "short", "live"),
        run_server_command(settings, "link", "create", "short"),
        run_server_command(settings, "simulate", "short", "--participants", "1"),
        run_server_command(settings, "seal", "short", "--out", str(sources / "seal.json")),
    ):
        assert (refused.returncode, refused.stderr.count("\n")) == (2, 1), refused.stderr
        assert "is archived. Remove it from the archive" in refused.stderr
    with services.database.read() as session:
        kept = session.query(Study).one()
        assert (kept.status, kept.active_version, len(kept.versions)) == ("closed", 1, 1)
        assert session.query(Link).count() == 1


def damage_clip(folder: Path) -> str:
    clip = next((folder / "clips").glob("*.mp4"))
    clip.write_bytes(clip.read_bytes() + b"x")
    return "expected sha256"


def remove_clip(folder: Path) -> str:
    next((folder / "clips").glob("*.mp4")).unlink()
    return "is missing from"


def remove_manifest(folder: Path) -> str:
    (folder / "clips" / "manifest.json").unlink()
    return "expected a manifest.json"


def break_manifest(folder: Path) -> str:
    (folder / "clips" / "manifest.json").write_text("{")
    return "is not valid JSON"


def drop_a_clip_from_the_manifest(folder: Path) -> str:
    path = folder / "clips" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["clips"] = manifest["clips"][1:]
    path.write_text(json.dumps(manifest))
    return "1 are missing from the manifest"


def misspell_a_level(folder: Path) -> str:
    path = folder / "clips" / "manifest.json"
    path.write_text(path.read_text().replace("a/slow", "a/sloww"))
    return "missing from the manifest"


def misspell_a_key(folder: Path) -> str:
    (folder / "short.toml").write_text(SHORT.replace("per_cell", "per_cel"))
    return "did you mean 'per_cell'?"


@pytest.mark.parametrize(
    "spoil",
    [
        damage_clip,
        remove_clip,
        remove_manifest,
        break_manifest,
        drop_a_clip_from_the_manifest,
        misspell_a_level,
        misspell_a_key,
    ],
    ids=lambda spoil: spoil.__name__,
)
def test_what_cannot_be_taken_in_is_refused_in_one_line(
    settings: Settings, services: Services, sources: Path, spoil
) -> None:
    expected = spoil(sources)
    refused = add(settings, sources, "--open")
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: ")
    assert refused.stderr.count("\n") == 1
    assert expected in refused.stderr
    assert not settings.clip_folder.exists()
    with services.database.read() as session:
        assert session.query(Study).count() == 0


def edit_manifest(folder: Path, **changes: object) -> None:
    path = folder / "clips" / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.parametrize(
    ("changes", "remedy"),
    [
        ({}, "build the clips with this definition"),
        ({"notes": [MADE_ELSEWHERE]}, "write the manifest again with `stimuli manifest` and --experiment"),
        ({"program_version": UPLOADED}, "upload those it declares, or correct the definition"),
    ],
    ids=["built", "own", "uploaded"],
)
def test_what_to_do_of_missing_clips_is_said_by_where_they_came_from(
    settings: Settings, services: Services, sources: Path, changes: dict[str, object], remedy: str
) -> None:
    drop_a_clip_from_the_manifest(sources)
    edit_manifest(sources, **changes)
    refused = add(settings, sources)
    assert refused.returncode == 2
    assert refused.stderr.endswith(f"{remedy}\n")


def test_a_manifest_of_own_clips_that_is_of_another_study_is_written_again(
    settings: Settings, services: Services, sources: Path
) -> None:
    edit_manifest(sources, experiment="clips")
    assert "were built for 'clips', not for 'short'" in add(settings, sources).stderr
    edit_manifest(sources, notes=[MADE_ELSEWHERE])
    told = add(settings, sources).stderr
    assert "is of 'clips', not of 'short'; write it again with `stimuli manifest` and --experiment" in told


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("export", "shrot", "--out", "x.csv"), "did you mean 'short'?"),
        (("study", "status", "short", "lvie"), "did you mean 'live'?"),
        (("link", "create", "short", "--kind", "persnal"), "did you mean 'personal'?"),
        (("link", "create", "short", "--count", "3"), "--kind personal"),
        (("run", "--host", "192.0.2.1"), "cannot listen on 192.0.2.1:8000"),
    ],
)
def test_other_bad_input_is_one_line_too(
    settings: Settings, study, services: Services, arguments: tuple[str, ...], expected: str
) -> None:
    study.change(status="draft")
    refused = run_server_command(settings, *arguments)
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: ")
    assert refused.stderr.count("\n") == 1
    assert expected in refused.stderr


@pytest.mark.parametrize(
    "command",
    [
        ("study", "list"),
        ("export", "short", "--out", "x.csv"),
        ("backup", "x.tar"),
        ("backup", "--to", "backups", "--recipient", str(Identity.generate().to_public())),
        ("database", "recount"),
        ("simulate", "short"),
        ("workspace", "list"),
        ("audit", "verify"),
    ],
    ids=lambda command: "-".join(command[:2]),
)
@pytest.mark.parametrize("empty_database_url", ["sqlite"], indirect=True)
def test_a_folder_without_a_database_gets_none(
    tmp_path: Path, empty_database_url: str, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty one made on the spot looked as if all studies were lost."""
    monkeypatch.chdir(tmp_path)
    file = Path(empty_database_url.removeprefix("sqlite:///"))
    settings = Settings(data_folder=tmp_path / "data", database_url=empty_database_url)
    refused = run_server_command(settings, *command)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"error: there is no database at {file}; ")
    assert refused.stderr.count("\n") == 1
    assert not file.exists()


@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
def test_a_database_without_tables_gets_none(
    tmp_path: Path, empty_database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty one, as SQLite makes it of a look at a file that is not there."""
    monkeypatch.chdir(tmp_path)
    settings = Settings(data_folder=tmp_path / "data", database_url=empty_database_url)
    with closing(open_services(settings).database) as database:
        assert current_revision(database) is None
    refused = run_server_command(settings, "study", "list")
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: there is an empty database at ")


def test_an_export_creates_the_folder_of_its_file(settings: Settings, study, tmp_path: Path) -> None:
    for command in (["export", "short"], ["audit", "export"]):
        out = tmp_path / command[0] / "new" / "x.csv"
        done = run_server_command(settings, *command, "--out", str(out))
        assert (done.returncode, done.stderr) == (0, "")
        assert out.is_file()


def test_a_refused_export_creates_no_folder(settings: Settings, study, tmp_path: Path) -> None:
    refused = run_server_command(settings, "export", "none", "--out", str(tmp_path / "new" / "x.csv"))
    assert refused.returncode == 2
    assert not (tmp_path / "new").exists()


def test_personal_links_come_as_a_table(settings: Settings, study) -> None:
    arguments = ("link", "create", "short", "--kind", "personal", "--label", "P", "--count", "3")
    lines = run_server_command(settings, *arguments).stdout.splitlines()
    assert [line.split(",")[0] for line in lines] == ["P001", "P002", "P003"]
    listed = run_server_command(settings, "link", "list", "short").stdout
    assert all(line.split(",")[1] in listed for line in lines)
    assert "live" in run_server_command(settings, "study", "list").stdout


def test_a_database_of_a_newer_program_is_left_alone(settings: Settings, services: Services) -> None:
    revise = "UPDATE alembic_version SET version_num = %s"
    with services.database.engine.begin() as connection:
        present = connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar_one()
        connection.exec_driver_sql(revise % "'9999'")
    try:
        refused = run_server_command(settings, "study", "list")
    finally:
        # The tests on PostgreSQL share one database, of which only the rows of our own tables are removed.
        with services.database.engine.begin() as connection:
            connection.exec_driver_sql(revise % f"'{present}'")
    assert refused.returncode == 2
    assert "newer version" in refused.stderr


@pytest.mark.parametrize(
    ("form", "begins"),
    [("runs", b"study,version,"), ("raw", b'{"'), ("codebook", b"# "), ("psych-ds", b"PK\x03\x04")],
)
def test_every_form_of_the_data_page_is_there_on_the_command_line(
    settings: Settings,
    study: StudyInDatabase,
    participant: Participant,
    sources: Path,
    form: str,
    begins: bytes,
) -> None:
    participant.agree().rate_all()
    out = sources / "out"
    done = run_server_command(settings, "export", "short", "--format", form, "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert out.read_bytes().startswith(begins)
    told = "the dataset is the folder short/ in the zip; to validate it, unpack the zip and check "
    assert (told in done.stdout.replace("\n", " ")) is (form == "psych-ds")
    unknown = run_server_command(settings, "export", "short", "--format", "jsn", "--out", str(out))
    assert unknown.returncode == 2
    assert "jsn" in unknown.stderr  # and the forms there are, in lines as wide as the terminal


def test_a_draft_is_rehearsed_and_no_count_of_people_knows(
    settings: Settings, study, services: Services
) -> None:
    study.change(status="draft", quota=1)
    assert run_server_command(settings, "simulate", "short", "--participants", "2").returncode == 0
    with services.database.read() as session:
        assert [run.origin for run in session.query(StudyRun)] == ["simulated"] * 2
        assert session.query(Study).one().status == "draft"
        pools = (
            Pool(study_id=1, origin=origin, series=1, scale=SCALE_NAME)
            for origin in ("participant", "pilot", "simulated")
        )
        counts = [pooled_tally(session, pool.runs(), SCALE_NAME, ()).answers.total() for pool in pools]
    assert counts[:2] == [0, 0]
    assert counts[2] >= 15


@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
def test_the_first_account_can_be_invited_before_the_server_ever_ran(
    empty_database_url: str, tmp_path: Path
) -> None:
    settings = Settings(data_folder=tmp_path / "data", database_url=empty_database_url, secret_key="k")
    called = run_server_command(settings, "admin", "link")
    assert (called.returncode, "/admin/invitation#" in called.stdout) == (0, True), called.stderr


def test_clips_without_a_size_are_reported_where_the_screen_is_measured(
    settings: Settings, services: Services, sources: Path
) -> None:
    manifest = sources / "clips" / "manifest.json"
    told = json.loads(manifest.read_text(encoding="utf-8")) | {"inter_ocular_px": None}
    assert "no clip says" not in add(settings, sources, "--name", "sized").stdout
    clips = [clip | {"width_mm": None} for clip in told["clips"]]
    manifest.write_text(json.dumps(told | {"clips": clips}), encoding="utf-8")
    said = add(settings, sources).stdout.replace("\n", " ")
    assert "no clip says how large it is to be shown" in said
    assert 'declare calibrate = "off" in [display]' in said
    text = (sources / "short.toml").read_text(encoding="utf-8")
    (sources / "short.toml").write_text(text + '\n[display]\ncalibrate = "off"\n', encoding="utf-8")
    assert "no clip says" not in add(settings, sources, "--name", "as_it_is").stdout
