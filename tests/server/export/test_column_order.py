"""Columns are next to what they belong to, or in the order used until 0.2 on request."""

import csv
import io
import zipfile
from itertools import pairwise
from typing import Any

import pytest

from experiments.columns import RUN_COLUMNS
from experiments.columns.column import OLD_ORDER
from experiments.kinds import views
from tests.helpers.admins import Admin
from tests.helpers.golden_databases import REVISIONS, golden_ratings

OLD = [name for name in OLD_ORDER["ratings"] if name != "levels"]
TOGETHER = [
    ("scale", "response"),
    ("run", "participant"),
    ("study_version", "data_series"),
    ("excluded", "exclusion_reason"),
    ("evidence_verdict", "evidence_points"),
]


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text.lstrip("\ufeff"), newline="")))


def test_what_belongs_together_is_together() -> None:
    for columns in (RUN_COLUMNS, *(view.columns for view in views())):
        names = [column.name for column in columns]
        neighbours = set(pairwise(names))
        for pair in TOGETHER:
            assert pair in neighbours or not set(pair) <= set(names), pair


@pytest.mark.parametrize("revision", REVISIONS)
def test_the_old_order_is_that_of_files_of_before(revision: str) -> None:
    orders = {view.name: [name for name in view.in_old_order().names if name != "levels"] for view in views()}
    for name, content in golden_ratings(revision).items():
        header = next(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")))
        known = {column for order in orders.values() for column in order}
        plain = [column for column in header if column in known]
        assert any(plain == [column for column in order if column in plain] for order in orders.values()), (
            name
        )


@pytest.mark.parametrize("form", ["ratings.csv", "wide.csv", "runs.csv"])
def test_a_download_has_the_same_cells_in_either_order(viewer: Admin, participant: Any, form: str) -> None:
    participant.agree().rate_all()
    new = viewer.get(f"/studies/short/data/{form}").text
    old = viewer.get(f"/studies/short/data/{form}?old_order=true").text
    assert new.splitlines()[0] != old.splitlines()[0]
    assert table(new) == table(old)
    header = [name for name in old.splitlines()[0].split(",") if name not in ("character", "speed")]
    if form == "ratings.csv":
        assert header == OLD


def test_a_dataset_and_its_codebook_have_one_order(viewer: Admin, participant: Any) -> None:
    participant.agree().rate_all()
    for query in ("", "?old_order=true"):
        content = viewer.get(f"/studies/short/data/psych-ds.zip{query}").content
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            name = next(path for path in archive.namelist() if path.endswith("ratings_data.csv"))
            header = archive.read(name).decode().splitlines()[0].split(",")
            book = next(path for path in archive.namelist() if path.endswith("codebook.md"))
            codebook = archive.read(book).decode()
        explained = [line.split("|")[1].strip() for line in codebook.splitlines() if line.startswith("| ")]
        assert explained[1 : 1 + len(header)] == header
