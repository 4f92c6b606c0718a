"""The Psych-DS dataset against the published rules.

The rules below are those of the schema model 1.5.1 that the official validator carries (`rules` of its
defaultSchema.json) and of schema.org's classes; the validator itself runs where it lies in
../shared/tools/psych-ds-validator.
"""

import csv
import io
import json
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.load import parse_experiment
from server.accounts.identity import OPERATOR
from server.context import Services
from server.studies.creation import add_version, store_clips
from server.studies.lookup import find_study
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, add_study
from tests.helpers.tiny_clips import make_clip_folder
from tests.server.trials.test_comparisons import PAIRS, compare, mains

VALIDATOR = Path(__file__).resolve().parents[4] / "shared/tools/psych-ds-validator/run.mjs"
DATA_FILE = re.compile(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
OFFICIAL_KEYWORDS = {
    "study", "site", "subject", "session", "task", "condition", "trial", "stimulus", "description",
}  # fmt: skip
REQUIRED_FIELDS = {"name", "description", "variableMeasured"}
PROPERTIES = {
    "Dataset": {
        "name", "description", "schemaVersion", "dateModified", "citation", "measurementTechnique",
        "keywords", "variableMeasured", "creator", "license",
    },
    "PropertyValue": {
        "name", "description", "additionalType", "unitText", "minValue", "maxValue", "valueReference",
    },
    "DefinedTerm": {"name", "description"},
    "Person": {"name", "identifier", "affiliation"},
    "Organization": {"name"},
}  # fmt: skip
"""Of the schema.org properties of each class, those used here; any other word would be no term."""
RECOMMENDED = {
    "MISSING_RESULTS_DIRECTORY", "MISSING_DIRECTORY_METADATA",
    "MISSING_SIDECAR_METADATA", "INVALID_SCHEMAORG_PROPERTY",
}  # fmt: skip
"""What the validator would like to see in any dataset; results come with a capsule. It warns of a
property that is not schema.org's without naming it; the rules below find none.
"""


@pytest.fixture
def dataset(viewer: Admin, participant: Participant, tmp_path: Path) -> Path:
    participant.agree().rate_all()
    return exported(viewer, tmp_path)


@pytest.fixture
def dataset_of_two_versions(viewer: Admin, client: TestClient, services: Services, tmp_path: Path) -> Path:
    """Runs of two versions: the factor `size` of the first is called `status` in the second."""
    first, second = (SHORT.replace('"speed"', f'"{name}"') for name in ("size", "status"))
    study = add_study(services, tmp_path / "clips", first)
    Participant(client, study.link_token).agree().rate_all()
    experiment = parse_experiment(second)
    manifest = make_clip_folder(experiment, tmp_path / "more")
    store_clips(services.clips, manifest, tmp_path / "more")
    with services.database.write() as session:
        add_version(
            session, find_study(session, "short", OPERATOR, "view"), second, experiment, manifest, None
        )
    Participant(client, study.link_token).agree().rate_all()
    return exported(viewer, tmp_path)


def exported(viewer: Admin, folder: Path) -> Path:
    content = viewer.get("/studies/short/data/psych-ds.zip").content
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        archive.extractall(folder)
    return folder / "short"


def described(dataset: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((dataset / "dataset_description.json").read_bytes().decode("utf-8"))
    return found


def test_every_file_is_where_the_rules_ask_and_none_is_empty(dataset: Path) -> None:
    present = {str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file()}
    assert {"dataset_description.json", "README.md", "CHANGES.md"} <= present
    assert {Path(name).parts[0] for name in present if "/" in name} == {
        "analysis",
        "data",
        "documentation",
        "materials",
    }
    assert all((dataset / name).stat().st_size > 0 for name in present)


def test_data_files_are_named_by_keywords_and_every_row_is_as_long_as_the_header(dataset: Path) -> None:
    tables = sorted((dataset / "data").iterdir())
    assert len(tables) == 3
    columns = {variable["name"] for variable in described(dataset)["variableMeasured"]}
    described_nowhere = set(columns)
    for table in tables:
        assert DATA_FILE.fullmatch(table.name), table.name
        keywords = [pair.split("-")[0] for pair in table.name.removesuffix("_data.csv").split("_")]
        assert set(keywords) <= OFFICIAL_KEYWORDS
        header, *rows = csv.reader(io.StringIO(table.read_bytes().decode("utf-8")))
        assert set(header) <= columns
        described_nowhere -= set(header)
        assert len(header) == len(set(header))
        assert rows
        assert {len(row) for row in rows} == {len(header)}
    assert described_nowhere == set()


def test_factors_of_all_versions_are_described_under_names_of_their_own(
    dataset_of_two_versions: Path,
) -> None:
    dataset = dataset_of_two_versions
    test_data_files_are_named_by_keywords_and_every_row_is_as_long_as_the_header(dataset)
    meanings = {variable["name"]: variable for variable in described(dataset)["variableMeasured"]}
    assert meanings["status"]["description"] == "State of the visit."
    for name in ("factor_size", "factor_status"):
        levels = meanings[name]["valueReference"]
        assert [level["name"] for level in levels] == ["slow", "fast"]
        assert f"| {name} |" in (dataset / "documentation" / "codebook.md").read_text()
    [table] = (dataset / "data").glob("*ratings*")
    rows = list(csv.DictReader(io.StringIO(table.read_text(encoding="utf-8"))))
    given = [row["factor_size"] or row["factor_status"] for row in rows if row["kind"] == "main"]
    assert len(given) == 16
    assert set(given) == {"slow", "fast"}
    assert not any(row["factor_size"] and row["factor_status"] for row in rows)


def test_the_description_is_schema_org_and_nothing_else(dataset: Path) -> None:
    description = described(dataset)
    assert description["@context"] == "https://schema.org/"
    assert set(description) >= REQUIRED_FIELDS
    check_object({name: value for name, value in description.items() if name != "@context"})


def check_object(node: dict[str, Any]) -> None:
    assert node["@type"] in PROPERTIES, f"an object without a known type: {node}"
    unknown = set(node) - {"@type"} - PROPERTIES[node["@type"]]
    assert unknown == set(), f"no properties of schema.org's {node['@type']}: {unknown}"
    for value in node.values():
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, dict):
                check_object(one)


def test_the_official_validator_agrees(dataset: Path) -> None:
    ask_the_official_validator(dataset)


def test_the_official_validator_agrees_on_two_versions(dataset_of_two_versions: Path) -> None:
    ask_the_official_validator(dataset_of_two_versions)


def test_the_official_validator_agrees_on_comparisons(
    viewer: Admin, client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", PAIRS)
    person = Participant(client, study.link_token).agree()
    for trial in mains(person):
        assert compare(person, trial, "left").status_code == 201
    dataset = exported(viewer, tmp_path)
    names = {path.name for path in (dataset / "data").iterdir()}
    assert names == {f"study-short_description-{table}_data.csv" for table in ("comparisons", "runs")}
    ask_the_official_validator(dataset)


def ask_the_official_validator(dataset: Path) -> None:
    if not VALIDATOR.is_file():
        pytest.skip("the official validator is not in ../shared/tools/psych-ds-validator")
    asked = ["node", str(VALIDATOR), str(dataset)]
    done = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=120)
    warnings = set(re.findall(r"^warning ([A-Z_]+)", done.stdout, re.MULTILINE))
    assert not re.findall(r"^error [A-Z_]+", done.stdout, re.MULTILINE), done.stdout
    assert warnings <= RECOMMENDED, done.stdout
    assert "VALID true" in done.stdout.splitlines(), done.stdout + done.stderr
    assert done.returncode == 0


def test_the_official_validator_refuses_a_folder_without_its_description(
    dataset: Path, tmp_path: Path
) -> None:
    if not VALIDATOR.is_file():
        pytest.skip("the official validator is not in ../shared/tools/psych-ds-validator")
    broken = tmp_path / "broken"
    shutil.copytree(dataset, broken)
    (broken / "dataset_description.json").unlink()
    done = subprocess.run(["node", str(VALIDATOR), str(broken)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
