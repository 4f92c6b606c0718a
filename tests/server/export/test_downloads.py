import csv
import io
import json
import zipfile
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from experiments.columns import RUN_COLUMNS
from experiments.kinds.clip_rating import RATINGS
from experiments.load import parse_experiment
from experiments.manifest import read_manifest
from server.accounts.identity import OPERATOR
from server.context import Services
from server.studies.creation import add_version
from server.studies.lookup import find_study
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study


def table(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text)))


def test_the_ratings_csv_has_the_columns_of_the_contract(viewer: Admin, participant: Participant) -> None:
    participant.agree().rate_all()
    rows = table(viewer.get("/studies/short/data/ratings.csv").text)
    assert rows[0] == RATINGS.csv_header(["character", "speed"])
    assert len(rows) == 1 + 12
    assert {len(row) for row in rows} == {len(rows[0])}


def test_the_runs_csv_has_one_row_a_visit_with_its_forms(viewer: Admin, participant: Participant) -> None:
    participant.agree()
    participant.request("PUT", "/forms/about", {"answers": {"age": 33}})
    header, row = table(viewer.get("/studies/short/data/runs.csv").text)
    names = [column.name for column in RUN_COLUMNS]
    place = names.index("forms")
    forms = ["form_about_age", "form_about_glasses_glasses", "form_about_glasses_lenses"]
    assert header == [*names[:place], *forms, *names[place + 1 :]]
    cells = dict(zip(header, row, strict=True))
    assert [cells[name] for name in forms] == ["33", "", ""]


ORIGINS = {"participant": 1, "pilot": 2, "simulated": 3}


@pytest.mark.parametrize("form", ["ratings.csv", "runs.csv", "raw.ndjson", "psych-ds.zip"])
def test_a_download_holds_one_origin_unless_all_are_asked_for(
    viewer: Admin, study: StudyInDatabase, client: TestClient, form: str
) -> None:
    study.change(status="pilot")
    for _ in range(2):
        Participant(client, study.link_token).agree().rate_all()
    study.change(status="live")
    Participant(client, study.link_token).agree().rate_all()
    link = study.link(synthetic=True)
    for _ in range(3):
        Participant(client, link).agree().rate_all()
    each = 12 if form in ("ratings.csv", "psych-ds.zip") else 1
    path = f"/studies/short/data/{form}"
    assert viewer.get(path).headers["palpebra-rows"] == str(each)
    for origin, number in ORIGINS.items():
        answer = viewer.get(f"{path}?origin={origin}")
        assert answer.headers["palpebra-rows"] == str(number * each)
        assert found_origins(form, answer.content) == {origin}
    everything = viewer.get(f"{path}?origin=all")
    assert everything.headers["palpebra-rows"] == str(6 * each)
    assert found_origins(form, everything.content) == set(ORIGINS)
    assert viewer.get(f"{path}?origin=preview").status_code == 422


@pytest.fixture
def two_series(client: TestClient, services: Services, tmp_path: Path) -> None:
    """One run on the scale to 7, then two on a scale to 5, which begins a series."""
    study = add_study(services, tmp_path / "clips", SHORT)
    Participant(client, study.link_token).agree().rate_all()
    shorter = SHORT.replace("[trial.scale]", "[trial.scale]\nmaximum = 5")
    experiment, manifest = parse_experiment(shorter), read_manifest(tmp_path / "clips")
    with services.database.write() as session:
        known = find_study(session, "short", OPERATOR, "view")
        assert add_version(session, known, shorter, experiment, manifest, None).series == 2
    for _ in range(2):
        Participant(client, study.link_token).agree().rate_all()


@pytest.mark.usefixtures("two_series")
@pytest.mark.parametrize("form", ["ratings.csv", "runs.csv", "raw.ndjson", "psych-ds.zip", "wide.csv"])
def test_a_download_holds_the_series_asked_for_and_names_it(viewer: Admin, form: str) -> None:
    each, path = 12 if form in ("ratings.csv", "psych-ds.zip") else 1, f"/studies/short/data/{form}"
    assert viewer.get(path).headers["palpebra-rows"] == str(3 * each)
    for series, number in ((1, 1), (2, 2)):
        answer = viewer.get(f"{path}?series={series}")
        assert answer.headers["palpebra-rows"] == str(number * each)
        assert f"short-series-{series}-{form}" in answer.headers["content-disposition"]
        if form.endswith(".csv"):
            rows = list(csv.DictReader(io.StringIO(answer.text)))
            assert [row["data_series"] for row in rows] == [str(series)] * number * each
        if form == "psych-ds.zip":
            with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
                declared = archive.read("short/materials/short.toml").decode()
            assert ("maximum = 5" in declared) is (series == 2)
    refused = viewer.get(f"{path}?series=3")
    assert (refused.status_code, refused.json()["error"]["message"]) == (
        404,
        "Study 'short' has no data series 3; there is series 1 (version 1), series 2 (version 2).",
    )


def found_origins(form: str, content: bytes) -> set[str]:
    if form == "psych-ds.zip":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            (name,) = (name for name in archive.namelist() if "ratings_data" in name)
            form, content = "ratings.csv", archive.read(name)
    if form == "raw.ndjson":
        *runs, _ = (json.loads(line) for line in content.splitlines())
        return {run["summary"]["origin"] for run in runs}
    return {row["run_origin"] for row in csv.DictReader(io.StringIO(content.decode()))}


def test_raw_data_are_json_lines(viewer: Admin, participant: Participant) -> None:
    participant.agree().rate_all()
    line, end = viewer.get("/studies/short/data/raw.ndjson").text.splitlines()
    assert json.loads(end) == {"complete": True, "runs": 1}
    assert len(json.loads(line)["trials"]) == 12


def test_the_codebook_explains_every_exported_column(viewer: Admin, study: StudyInDatabase) -> None:
    text = viewer.get("/studies/short/data/codebook.md").text
    for name in [
        *RATINGS.csv_header(["character", "speed"]),
        *(column.name for column in RUN_COLUMNS if column.name != "forms"),
    ]:
        assert f"| {name} |" in text


def test_an_unknown_study_is_refused_before_the_download_begins(
    viewer: Admin, study: StudyInDatabase
) -> None:
    answer = viewer.get("/studies/shrt/data/ratings.csv")
    assert answer.status_code == 404
    assert "did you mean 'short'?" in answer.json()["error"]["message"]
