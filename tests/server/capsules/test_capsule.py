"""The capsule of exp3 with 20 runs: verified in another folder, and refused once anything in it differs."""

import json
import shutil
import subprocess
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings, strategies
from typer.testing import CliRunner

from analysis.cli import app as analysis
from experiments.capsule import CAPSULE_FILE, MANIFEST, SOFTWARE_FILE, CapsuleError, open_capsule
from experiments.errors import InputError
from experiments.load import FOLDER, parse_experiment
from experiments.manifest import Manifest
from experiments.seal import deviations, read_clips_sha256, read_seal
from server.accounts.identity import OPERATOR
from server.app import create_app
from server.context import Services, open_services
from server.core.errors import NotFound
from server.core.settings import Settings
from server.exports.capsules import CapsuleContents, _without_answers, build_capsule
from server.exports.seals import seal_plan
from server.models import Job
from server.studies.creation import add_version
from server.studies.lookup import find_study
from tests.helpers.admins import Admin, signed_in
from tests.helpers.studies import Participant, add_study
from tests.server.export.test_psych_ds import VALIDATOR

RUNS = 20
CREDIT = """
[dataset]
licence = "CC-BY-4.0"

[[dataset.creators]]
name = "Jane Doe"
orcid = "0000-0002-1825-0097"
affiliation = "University of Examples"
"""


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory, sqlite_template: Path) -> Iterator[Services]:
    """exp3 with 20 complete runs, the answers following the lower lid so that there is something to find."""
    folder = tmp_path_factory.mktemp("capsule")
    shutil.copy(sqlite_template, folder / "test.sqlite")
    address = f"sqlite:///{folder / 'test.sqlite'}"
    services = open_services(Settings(data_folder=folder, database_url=address, secret_key="test key"))
    text = (FOLDER / "exp3.toml").read_text(encoding="utf-8") + CREDIT
    study = add_study(services, folder / "clips", text)
    with services.database.write() as session:
        seal_plan(session, find_study(session, "exp3", OPERATOR, "view"), None, None)
    app = create_app(services.settings)
    app.state.services = services
    with TestClient(app) as client:
        for number in range(RUNS):
            _take_part(Participant(client, study.link_token), number)
    yield services
    services.database.close()


def _take_part(person: Participant, number: int) -> None:
    person.agree()
    for form in person.state()["forms"]:
        answers = {"age": 20 + number, "gender": "other", "vision": "normal"}
        known = {field["name"] for field in form["fields"]}
        given = {name: value for name, value in answers.items() if name in known}
        assert person.request("PUT", f"/forms/{form['name']}", {"answers": given}).status_code == 200
    for trial in person.state()["trials"]:
        asked = [int(word) for word in (trial["prompt"] or "").replace("*", " ").split() if word.isdigit()]
        shown = sum(map(ord, trial["clip_sha256"] or "")) % 3
        response = asked[0] if asked else 2 + (number + trial["trial_index"] * 7 + shown) % 5
        assert person.rate(trial, response).status_code == 201
    assert person.request("POST", "/complete").status_code == 200


@pytest.fixture(scope="module")
def capsule(opened: Services) -> Path:
    target = opened.settings.data_folder / "exp3-capsule.zip"
    build_capsule(opened.database, opened.clips, "exp3", CapsuleContents(sensitivity=False), target)
    return target


@pytest.fixture
def unpacked(capsule: Path, tmp_path: Path) -> Path:
    with zipfile.ZipFile(capsule) as archive:
        archive.extractall(tmp_path / "unpacked")
    return tmp_path / "unpacked"


def verify(place: Path, *options: str) -> tuple[int, str]:
    result = CliRunner().invoke(analysis, ["verify", str(place), *options])
    if isinstance(result.exception, InputError):
        return 2, str(result.exception)
    return result.exit_code, result.output


def test_it_is_verified_in_another_folder(capsule: Path, tmp_path: Path) -> None:
    elsewhere = shutil.copy(capsule, tmp_path / "from a friend.zip")
    code, said = verify(Path(elsewhere))
    assert code == 0, said
    assert "all as listed" in said
    assert "verified: every table is as printed, every figure is the same byte for byte" in said


def test_it_holds_what_the_study_is_made_of(unpacked: Path) -> None:
    present = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file()}
    assert {
        "README.md", "dataset_description.json", "ro-crate-metadata.json", CAPSULE_FILE,
        "materials/exp3.toml", "materials/manifest.json", "materials/sealed-plan.json",
        "materials/sealed-plan.html", "documentation/codebook.md",
        "documentation/software.json", "analysis/plan.json", "analysis/analysis.R", "analysis/analysis.py",
        "results/report.html", "results/tables.tex", "results/results.json", "results/methods.txt",
    } <= present  # fmt: skip
    manifest = json.loads((unpacked / "materials/manifest.json").read_text(encoding="utf-8"))
    assert {f"materials/clips/{clip['file']}" for clip in manifest["clips"]} <= present
    numbers = json.loads((unpacked / "results/results.json").read_text(encoding="utf-8"))
    assert numbers["n_participants"] == RUNS
    assert any("deviation from the plan sealed" in line for line in numbers["sealed_plan"]["said"])
    versions = json.loads((unpacked / "documentation/software.json").read_text(encoding="utf-8"))
    assert {"numpy", "matplotlib", "palpebra", "scipy"} <= set(versions["packages"])


@pytest.mark.parametrize(
    "path", ["data/study-exp3_description-ratings_data.csv", "results/tables.tex", "materials/exp3.toml"]
)
def test_a_changed_byte_is_refused_with_the_files_name(unpacked: Path, path: str) -> None:
    content = bytearray((unpacked / path).read_bytes())
    content[len(content) // 2] ^= 1
    (unpacked / path).write_bytes(content)
    code, said = verify(unpacked)
    assert code == 2
    assert said.startswith(f"{path}: the file was changed: expected sha256")
    assert "\n" not in said


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=strategies.floats(0, 1, exclude_max=True), bit=strategies.integers(0, 7))
def test_no_changed_byte_of_the_zip_changes_a_file_unseen(
    capsule: Path, tmp_path_factory: pytest.TempPathFactory, at: float, bit: int
) -> None:
    content = bytearray(capsule.read_bytes())
    content[int(at * len(content))] ^= 1 << bit
    folder = tmp_path_factory.mktemp("changed")
    (folder / "c.zip").write_bytes(content)
    (folder / "files").mkdir()
    try:
        open_capsule(folder / "c.zip", folder / "files")
    except CapsuleError:
        return
    # A date or a comment of the zip itself: what was unpacked is the same, file by file.
    with zipfile.ZipFile(capsule) as archive:
        for name in archive.namelist():
            assert (folder / "files" / name).read_bytes() == archive.read(name)


def test_a_changed_list_is_refused(unpacked: Path) -> None:
    listed = (unpacked / CAPSULE_FILE).read_text(encoding="utf-8")
    (unpacked / CAPSULE_FILE).write_text(listed.replace('"study": "exp3"', '"study": "exp4"'))
    code, said = verify(unpacked)
    assert (code, said.split(":")[0]) == (2, CAPSULE_FILE)


def test_a_missing_file_is_named(unpacked: Path) -> None:
    (unpacked / "results/tables.tex").unlink()
    assert verify(unpacked) == (
        2, "results/tables.tex: missing from the capsule; download it again",
    )  # fmt: skip


def test_a_foreign_file_is_named(unpacked: Path, capsule: Path, tmp_path: Path) -> None:
    (unpacked / "data/mine.csv").write_text("a,b\n")
    code, said = verify(unpacked)
    assert (code, said.split(":")[0]) == (2, "data/mine.csv")
    assert "not part of the capsule" in said
    for name in ("../outside.txt", "/etc/outside", "mine.txt"):
        added = Path(shutil.copy(capsule, tmp_path / "added.zip"))
        with zipfile.ZipFile(added, "a") as archive:
            archive.writestr(name, "x")
        assert verify(added)[0] == 2
        assert not (tmp_path / "outside.txt").exists()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 and no more", b"no zip at all" * 99])
def test_what_is_not_a_capsule_gets_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "c.zip").write_bytes(content)
    code, said = verify(tmp_path / "c.zip")
    assert code == 2
    assert said.startswith("c.zip: expected the zip of a capsule")
    assert "found nothing" in verify(tmp_path / "nowhere.zip")[1]


def relist(folder: Path) -> None:
    """Write the list again, as somebody would to deceive, or to correct."""
    from experiments.capsule import Capsule, listed_files

    data = json.loads((folder / CAPSULE_FILE).read_text(encoding="utf-8"))
    data.pop("sha256")
    known = Capsule.model_validate(data)
    changed = known.model_copy(update={"files": listed_files(folder)})
    (folder / CAPSULE_FILE).write_text(changed.text(), encoding="utf-8")


@pytest.mark.parametrize("path", ["/etc/hostname", "../outside.csv", "data/none.csv"])
def test_a_report_made_of_files_outside_is_refused(unpacked: Path, path: str) -> None:
    from experiments.capsule import Capsule

    data = json.loads((unpacked / CAPSULE_FILE).read_text(encoding="utf-8"))
    data.pop("sha256")
    data["report"]["answers"] = path
    (unpacked / CAPSULE_FILE).write_text(Capsule.model_validate(data).text(), encoding="utf-8")
    code, said = verify(unpacked)
    assert code == 2
    assert f"the report was made from '{path}', which the list does not contain" in " ".join(said.split())


def test_a_list_that_is_not_an_object_gets_one_line(unpacked: Path) -> None:
    (unpacked / CAPSULE_FILE).write_text("[1, 2]", encoding="utf-8")
    code, said = verify(unpacked)
    assert code == 2
    assert "not the JSON of a capsule" in said


def test_a_report_that_the_data_do_not_give_is_not_verified(unpacked: Path) -> None:
    tables = unpacked / "results/tables.tex"
    tables.write_text(tables.read_text(encoding="utf-8").replace("0.", "9.", 1), encoding="utf-8")
    relist(unpacked)
    code, said = verify(unpacked)
    assert code == 1
    assert "tables.tex: line" in said
    assert "NOT verified: tables differ" in said


def test_other_versions_are_named_where_a_figure_differs(unpacked: Path) -> None:
    data = json.loads((unpacked / CAPSULE_FILE).read_text(encoding="utf-8"))
    data["software"]["packages"]["matplotlib"] = "3.0.0"
    (unpacked / CAPSULE_FILE).write_text(json.dumps(data), encoding="utf-8")
    (unpacked / SOFTWARE_FILE).write_text(json.dumps(data["software"]), encoding="utf-8")
    figure = next((unpacked / "results").glob("*.svg"))
    figure.write_bytes(figure.read_bytes() + b"\n")
    relist(unpacked)
    code, said = verify(unpacked)
    assert code == 0, said
    assert f"{figure.name}: " in said
    assert "matplotlib 3.0.0 became " in said
    assert "verified: every table is as printed" in said


def test_versions_changed_in_the_list_alone_are_refused(unpacked: Path) -> None:
    data = json.loads((unpacked / CAPSULE_FILE).read_text(encoding="utf-8"))
    data["software"]["packages"]["matplotlib"] = "3.0.0"
    (unpacked / CAPSULE_FILE).write_text(json.dumps(data), encoding="utf-8")
    relist(unpacked)
    code, said = verify(unpacked)
    assert (code, said.split(":")[0]) == (2, SOFTWARE_FILE)


def test_a_file_of_the_report_that_nobody_can_make_again_is_named(unpacked: Path) -> None:
    (unpacked / "results/table9.md").write_text("| p | 0.001 |", encoding="utf-8")
    relist(unpacked)
    code, said = verify(unpacked)
    assert code == 1
    assert "table9.md: in the capsule's report, and not made by the analysis" in said


def test_other_clips_than_sealed_are_a_deviation(unpacked: Path) -> None:
    seal = read_seal(unpacked / "materials/sealed-plan.json")
    shown = read_clips_sha256(unpacked / MANIFEST)
    assert shown == seal.clips_sha256
    assert deviations(seal, seal.experiment, seal.experiment.participants, shown) == []
    manifest = json.loads((unpacked / MANIFEST).read_text(encoding="utf-8"))
    manifest["clips"][0]["sha256"] = "0" * 64
    (unpacked / MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
    relist(unpacked)
    code, said = verify(unpacked)
    assert code == 1
    assert "NOT verified: tables differ" in said
    found = deviations(
        seal, seal.experiment, seal.experiment.participants, read_clips_sha256(unpacked / MANIFEST)
    )
    assert [line.split(" (")[0] for line in found] == ["the clips shown differ from the sealed clips"]


def test_the_psych_ds_validator_agrees(unpacked: Path) -> None:
    if not VALIDATOR.is_file():
        pytest.skip("the official validator is not in ../shared/tools/psych-ds-validator")
    asked = ["node", str(VALIDATOR), str(unpacked)]
    done = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=120)
    assert "VALID true" in done.stdout.splitlines(), done.stdout + done.stderr
    described = json.loads((unpacked / "dataset_description.json").read_text(encoding="utf-8"))
    assert described["license"] == "https://spdx.org/licenses/CC-BY-4.0"
    assert described["creator"][0]["identifier"] == "https://orcid.org/0000-0002-1825-0097"


def test_the_crate_says_what_each_file_is(unpacked: Path) -> None:
    crate = json.loads((unpacked / "ro-crate-metadata.json").read_text(encoding="utf-8"))
    assert crate["@context"] == "https://w3id.org/ro/crate/1.2/context"
    entities = {entity["@id"]: entity for entity in crate["@graph"]}
    assert entities["ro-crate-metadata.json"]["conformsTo"] == {"@id": "https://w3id.org/ro/crate/1.2"}
    root = entities["./"]
    assert {"name", "description", "datePublished", "license", "author", "hasPart"} <= set(root)
    assert root["license"] == {"@id": "https://spdx.org/licenses/CC-BY-4.0"}
    parts = {unquote(part["@id"]) for part in root["hasPart"]}
    present = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file()}
    assert parts == present - {"ro-crate-metadata.json"}
    from experiments.manifest import file_sha256

    for part in parts - {CAPSULE_FILE}:
        assert entities[part]["sha256"] == file_sha256(unpacked / part)
    mentioned = [one["@id"] for one in entities["#analysis"]["object"]]
    assert mentioned == [
        "materials/exp3.toml",
        "data/study-exp3_description-ratings_data.csv",
        "data/study-exp3_description-runs_data.csv",
    ]


def test_answers_to_motion_checks_stay_out() -> None:
    check = {"kind": "digit", "sha256": "0" * 64, "answer": "7"}
    kept = _without_answers({"name": "x", "clips": [], "checks_seed": 5, "checks": [check]})
    assert kept == {"name": "x", "clips": [], "checks": [{"kind": "digit", "sha256": "0" * 64}]}


def test_the_clips_can_stay_out(opened: Services, tmp_path: Path) -> None:
    target = tmp_path / "small.zip"
    build_capsule(
        opened.database, opened.clips, "exp3", CapsuleContents(clips=False, sensitivity=False), target
    )
    with zipfile.ZipFile(target) as archive:
        assert not [name for name in archive.namelist() if name.endswith(".mp4")]
        assert len(json.loads(archive.read("materials/manifest.json"))["clips"][0]["sha256"]) == 64
    assert verify(target, "--no-report")[0] == 0


def test_a_study_without_answers_has_no_capsule(opened: Services, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="because its report failed"):
        build_capsule(
            opened.database, opened.clips, "exp3", CapsuleContents(origin="pilot"), tmp_path / "none.zip"
        )
    assert list(tmp_path.iterdir()) == []


def test_a_capsule_of_an_earlier_series_holds_its_definition(opened: Services, tmp_path: Path) -> None:
    """A later version with another scale and no answers yet is in use; its report could not be made."""
    shutil.copytree(opened.settings.data_folder, tmp_path / "data")
    address = f"sqlite:///{tmp_path / 'data' / 'test.sqlite'}"
    services = open_services(
        opened.settings.model_copy(update={"data_folder": tmp_path / "data", "database_url": address})
    )
    try:
        with services.database.write() as session:
            study = find_study(session, "exp3", OPERATOR, "view")
            (first,) = study.versions
            text = first.definition_toml.replace("maximum = 7", "maximum = 5")
            manifest = Manifest.model_validate(first.manifest)
            assert add_version(session, study, text, parse_experiment(text), manifest, None).series == 2
        target = tmp_path / "first.zip"
        build_capsule(
            services.database,
            services.clips,
            "exp3",
            CapsuleContents(clips=False, sensitivity=False, series=1),
            target,
        )
        with zipfile.ZipFile(target) as archive:
            assert b"maximum = 5" not in archive.read("materials/exp3.toml")
            assert json.loads(archive.read(CAPSULE_FILE))["report"]["series"] == 1
        assert verify(target)[0] == 0
        with pytest.raises(NotFound, match="no data series 3; there is series 1"):
            build_capsule(services.database, services.clips, "exp3", CapsuleContents(series=3), target)
    finally:
        services.database.close()


@pytest.fixture(scope="module")
def owner(opened: Services) -> Iterator[Admin]:
    app = create_app(opened.settings)
    with TestClient(app) as client:
        yield signed_in(client, app.state.services, "owner")


def test_a_capsule_is_made_and_downloaded_from_the_dashboard(owner: Admin, tmp_path: Path) -> None:
    order = {"origin": "participant", "clips": False, "sensitivity": False}
    begun = owner.send("POST", "/studies/exp3/capsules", order)
    assert begun.status_code == 202, begun.text
    until = time.monotonic() + 300
    while any(one["status"] in ("queued", "running") for one in owner.get("/studies/exp3/capsules").json()):
        assert time.monotonic() < until
        time.sleep(0.1)
    made = owner.get("/studies/exp3/capsules").json()[-1]
    assert (made["status"], made["message"]) == ("done", "")
    target = tmp_path / "capsule.zip"
    target.write_bytes(owner.get(f"/studies/exp3/capsules/{made['id']}.zip").content)
    assert target.stat().st_size == made["bytes"]
    (unpacked := tmp_path / "opened").mkdir()
    capsule, _ = open_capsule(target, unpacked)
    assert capsule.sha256 == made["sha256"]


def test_one_capsule_of_a_study_at_a_time(opened: Services, owner: Admin) -> None:
    with opened.database.write() as session:
        study = find_study(session, "exp3", OPERATOR, "view")
        job = Job(public_id="a" * 32, kind="capsule", study_id=study.id, status="queued", message="")
        session.add(job)
    refused = owner.send("POST", "/studies/exp3/capsules", {})
    with opened.database.write() as session:
        session.delete(session.merge(job))
    assert (refused.status_code, "already being made" in refused.text) == (409, True)


def test_a_capsule_of_no_series_is_refused_before_it_is_begun(owner: Admin) -> None:
    listed = owner.get("/studies/exp3/capsules").json()
    refused = owner.send("POST", "/studies/exp3/capsules", {"series": 9})
    assert (refused.status_code, "there is series 1 (version 1)" in refused.text) == (404, True)
    assert owner.get("/studies/exp3/capsules").json() == listed
