"""The list of participants: a page at a time, however many there are."""

from typing import Any

import pytest
from sqlalchemy import select, text

from server.context import Services
from server.models import StudyRun
from tests.helpers.admins import Admin
from tests.helpers.statements import statements
from tests.helpers.studies import Participant

RUNS = "/studies/short/runs"
MORE_THAN_PARAMETERS = 70_000
"""A statement of PostgreSQL takes 65,535 parameters."""


def copy_runs(services: Services, count: int, simulated: int = 0) -> None:
    """Copies of the one run there is, in one statement, the first ones of simulated people."""
    own = {"id", "public_id", "client_id", "token_hash"}
    names = [column.name for column in StudyRun.__table__.columns if column.name not in own]
    values = {name: f"study_runs.{name}" for name in names}
    values["origin"] = f"CASE WHEN i <= {simulated} THEN 'simulated' ELSE study_runs.origin END"
    numbers = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < :count)"
    statement = (
        f"{numbers} INSERT INTO study_runs (public_id, client_id, token_hash, {', '.join(names)}) "
        f"SELECT 'copy' || i, 'copy' || i, 'copy' || i, {', '.join(values.values())} "
        "FROM study_runs, n"
    )
    if services.database.is_sqlite:  # which wants WITH behind INSERT INTO
        head, _, tail = statement.partition("INSERT INTO")
        into, _, rest = tail.partition("SELECT")
        statement = f"INSERT INTO{into}{head}SELECT{rest}"
    with services.database.write() as session:
        session.execute(text(statement), {"count": count})


def listed(viewer: Admin, **asked: Any) -> dict[str, Any]:
    answer = viewer.get(RUNS, params=asked)
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


def test_more_runs_than_a_statement_has_parameters_are_listed(
    services: Services, viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    copy_runs(services, MORE_THAN_PARAMETERS)
    page = listed(viewer)
    assert page["total"] == MORE_THAN_PARAMETERS + 1
    assert len(page["runs"]) == 100
    assert listed(viewer, before=page["next"])["runs"][0]["run"] == f"copy{MORE_THAN_PARAMETERS - 100}"


def test_every_run_is_on_one_page(services: Services, viewer: Admin, participant: Participant) -> None:
    participant.agree()
    copy_runs(services, 6)
    seen: list[str] = []
    before: dict[str, str] = {}
    while True:
        page = listed(viewer, limit=3, **before)
        seen += [run["run"] for run in page["runs"]]
        if page["next"] is None:
            break
        before = {"before": page["next"]}
    with services.database.read() as session:
        assert seen == list(session.scalars(select(StudyRun.public_id).order_by(StudyRun.id.desc())))


def test_runs_are_searched_and_chosen_by_the_server(
    services: Services, viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    copy_runs(services, 3)
    with services.database.write() as session:
        session.query(StudyRun).filter_by(public_id="copy2").update(
            {"participant": "Ada_1", "status": "complete"}
        )
    for asked in ({"search": "ada_"}, {"show": "complete"}, {"search": "COPY2"}):
        assert [run["participant"] for run in listed(viewer, **asked)["runs"]] == ["Ada_1"], asked
    assert listed(viewer, show="not_complete")["total"] == 3
    assert listed(viewer, search="a_a")["total"] == 0  # _ stands for itself
    assert viewer.get(RUNS, params={"before": "nothing"}).status_code == 404


@pytest.mark.parametrize("show", ["everybody", "complete", "not_complete", "excluded"])
def test_simulated_people_are_listed_where_asked_for_alone(
    services: Services, viewer: Admin, participant: Participant, show: str
) -> None:
    participant.agree()
    copy_runs(services, 3, simulated=1)
    values = {"complete": {"status": "complete"}, "excluded": {"excluded": True}}
    with services.database.write() as session:
        session.query(StudyRun).update(values.get(show, {"status": "active"}))
    people = listed(viewer, show=show)
    both = listed(viewer, show=show, simulated=True)
    assert "copy1" not in {run["run"] for run in people["runs"]}
    assert people["total"] == len(people["runs"]) == 3
    assert both["total"] == 4
    assert [run["run"] for run in listed(viewer, show="simulated")["runs"]] == ["copy1"]


def test_runs_are_looked_through_once_where_they_fit_on_a_page(
    services: Services, viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    copy_runs(services, 6)
    served = viewer.client.app.state.services
    for asked, total, counts in (
        ({"search": "copy"}, 6, 0),
        ({"search": "copy", "limit": 6}, 6, 0),
        ({"search": "copy", "limit": 5}, 6, 1),
        ({"search": "nobody"}, 0, 0),
    ):
        with statements(served) as sent:
            assert listed(viewer, **asked)["total"] == total
        counted = [one for one in sent if "count(*)" in one and "FROM study_runs" in one]
        assert len(counted) == counts, asked
    assert listed(viewer, search="copy", before="copy2")["total"] == 6


def test_letters_beyond_ascii_are_folded_too(
    services: Services, viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    with services.database.write() as session:
        session.query(StudyRun).update({"participant": "\u00c4da %"})
    for search, total in (("\u00e4D", 1), ("DA ", 1), ("da %", 1), ("a_", 0), ("\u00e4x", 0)):
        assert listed(viewer, search=search)["total"] == total, search
