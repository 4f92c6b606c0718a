"""An attacker's formulas: no table that the server hands out holds a cell that a spreadsheet would run."""

import csv
import io
import json
import re
import zipfile
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from table_files.formulas import unguarded_cell
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, add_study

RUNS = ("=", "+", "-", "@", "＝", "＋", "－", "＠", "\t", "\r", "\n")
EVIL = [
    "fine\n=1+1;ok",
    "a;=[book.xlsx]S!A1",
    "a;=#REF!",
    "a\n@SUM(1)",
    "=1+1",
    "＝1+1",
    "@SUM(1)",
    "+1+1",
    "-1+cmd|' /C calc'!A0",
    "\t=1+1",
    "thanks;=1+1",
    "a\r=1+1",
]


def texts_of(table: bytes) -> Iterator[str]:
    """Every cell as a spreadsheet splits it, whether its separator is a comma, a semicolon or a tab."""
    text = table.decode("utf-8-sig")
    for separator in (",", ";", "\t"):
        for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator):
            yield from row
    for row in csv.reader(io.StringIO(text, newline="")):
        for cell in row:
            yield from re.split(r"[;\t\r\n]", cell) if cell.strip() else ()


def runnable(table: bytes) -> list[str]:
    """The cells that would run."""
    found = []
    for cell in texts_of(table):
        if cell.lstrip().startswith(RUNS) or cell.startswith(RUNS):
            try:
                float(cell)
            except ValueError:
                found.append(cell)
    return found


@pytest.mark.parametrize("evil", EVIL)
def test_no_download_runs_what_a_visitor_wrote(
    owner: Admin, services: Services, client: TestClient, tmp_path: Any, evil: str
) -> None:
    text = SHORT.replace('type = "number"\nname = "age"', 'type = "text"\nname = "age"').replace(
        "minimum = 18\nmaximum = 120\n", ""
    )
    study = add_study(services, tmp_path / "clips", text)
    person = Participant(client, study.link(recruiter={"kind": "generic", "id_parameter": "id"}))
    person.start(query={"id": "known-1", "note": evil, evil[:90]: "x"})
    person.request("PUT", "/consent", {"agreed": True})
    person.request("PUT", "/forms/about", {"answers": {"age": evil}})
    labelled = owner.send("POST", "/studies/short/links", {"kind": "personal", "labels": [evil]})
    assert labelled.status_code == 201
    tables = {
        path: owner.get(f"/studies/short/{path}").content
        for path in ("data/ratings.csv", "data/runs.csv", "data/identities.csv", "links/personal.csv")
    }
    with zipfile.ZipFile(io.BytesIO(owner.get("/studies/short/data/psych-ds.zip").content)) as archive:
        tables |= {name: archive.read(name) for name in archive.namelist() if name.endswith(".csv")}
    assert {path: runnable(table) for path, table in tables.items()} == {path: [] for path in tables}
    [_, known] = csv.reader(io.StringIO(tables["data/identities.csv"].decode(), newline=""))
    assert evil in json.loads(unguarded_cell(known[-1])).values()
