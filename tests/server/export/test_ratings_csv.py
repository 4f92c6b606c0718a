import csv
import io
import json
from typing import Any

from experiments.kinds.clip_rating import RATINGS
from server.context import Services
from server.exports.csv_lines import rating_rows
from server.exports.formats import ratings_csv
from server.exports.schemas import EVERYTHING
from server.models import Study
from tests.helpers.studies import Participant


def loaded(column_type: str, cell: str) -> Any:
    """A CSV cell as the column's type says; empty is missing."""
    if cell == "":
        return None
    return {"integer": int, "number": float, "boolean": lambda text: bool(int(text))}.get(column_type, str)(
        cell
    )


def test_export_and_load_is_the_identity(participant: Participant, services: Services) -> None:
    participant.agree()
    comments = ["plain", 'with "quotes", commas', "two\nlines", "Lidschlag äöü 👁", ""]
    for trial, comment in zip(participant.state()["trials"], comments, strict=False):
        participant.rate(trial, comment=comment)
    with services.database.read() as session:
        study = session.query(Study).one()
        stream = io.StringIO(b"".join(ratings_csv(session, study, EVERYTHING)).decode("utf-8"), newline="")
        rows = [dict(zip(RATINGS.names, row, strict=True)) for row in rating_rows(session, study, EVERYTHING)]
    read = list(csv.DictReader(stream))
    assert len(read) == 5
    factors = RATINGS.factors_in_header(read[0])
    assert factors == ["character", "speed"]
    for row, line in zip(rows, read, strict=True):
        for column in RATINGS.columns:
            assert column.admits(row[column.name]), column.name
            if column.name == "levels":
                levels = json.loads(row["levels"]) if row["levels"] else {}
                assert {name: line[name] for name in factors if line[name]} == levels
            else:
                value = (
                    bool(row[column.name])
                    if column.type == "boolean" and row[column.name] is not None
                    else row[column.name]
                )
                assert loaded(column.type, line[column.name]) == (None if value == "" else value), column.name


def test_an_empty_study_exports_its_header(services: Services, study: Any) -> None:
    with services.database.read() as session:
        exported = b"".join(ratings_csv(session, session.query(Study).one(), EVERYTHING)).decode("utf-8")
    assert exported.strip() == ",".join(RATINGS.csv_header(["character", "speed"]))
