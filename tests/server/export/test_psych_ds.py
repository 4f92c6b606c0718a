"""The Psych-DS dataset against the published rules.

The rules below are those of the schema model that the official validator 1.4.0 carries (`rules` of its
defaultSchema.json) and of schema.org's classes; the validator itself runs where its command is found.
"""

import csv
import io
import json
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.admins import Admin
from tests.helpers.studies import Participant

DATA_FILE = re.compile(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
OFFICIAL_KEYWORDS = {
    "study", "site", "subject", "session", "task", "condition", "trial", "stimulus", "description",
}  # fmt: skip
REQUIRED_FIELDS = {"name", "description", "variableMeasured"}
PROPERTIES = {
    "Dataset": {
        "name", "description", "schemaVersion", "dateModified", "citation", "measurementTechnique",
        "keywords", "variableMeasured",
    },
    "PropertyValue": {"name", "description", "additionalType", "unitText", "valueReference"},
    "DefinedTerm": {"name"},
}  # fmt: skip
"""Of the schema.org properties of each class, those used here; any other word would be no term."""


@pytest.fixture
def dataset(viewer: Admin, participant: Participant, tmp_path: Path) -> Path:
    participant.agree().rate_all()
    content = viewer.get("/studies/short/data/psych-ds.zip").content
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path)
    return tmp_path / "short"


def described(dataset: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((dataset / "dataset_description.json").read_bytes().decode("utf-8"))
    return found


def test_every_file_is_where_the_rules_ask_and_none_is_empty(dataset: Path) -> None:
    present = {str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file()}
    assert {"dataset_description.json", "README.md", "CHANGES.md"} <= present
    assert {Path(name).parts[0] for name in present if "/" in name} == {"data", "documentation", "materials"}
    assert all((dataset / name).stat().st_size > 0 for name in present)


def test_data_files_are_named_by_keywords_and_every_row_is_as_long_as_the_header(dataset: Path) -> None:
    tables = sorted((dataset / "data").iterdir())
    assert len(tables) == 2
    columns = {variable["name"] for variable in described(dataset)["variableMeasured"]}
    for table in tables:
        assert DATA_FILE.fullmatch(table.name), table.name
        keywords = [pair.split("-")[0] for pair in table.name.removesuffix("_data.csv").split("_")]
        assert set(keywords) <= OFFICIAL_KEYWORDS
        header, *rows = csv.reader(io.StringIO(table.read_bytes().decode("utf-8")))
        assert set(header) <= columns
        assert len(header) == len(set(header))
        assert rows
        assert {len(row) for row in rows} == {len(header)}


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
    command = os.environ.get("PSYCHDS_VALIDATOR") or shutil.which("psychds-validator")
    if not command:
        pytest.skip("the official validator is not installed; PSYCHDS_VALIDATOR names its command")
    done = subprocess.run([*command.split(), str(dataset)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "error" not in done.stdout.lower(), done.stdout
