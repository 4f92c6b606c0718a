"""Links on the dashboard: many at once, a page at a time."""

from typing import Any

from tests.helpers.admins import Admin
from tests.helpers.statements import statements
from tests.helpers.studies import Participant, StudyInDatabase

LINKS = "/studies/short/links"


def made(experimenter: Admin, **body: Any) -> list[dict[str, Any]]:
    answer = experimenter.send("POST", LINKS, body)
    assert answer.status_code == 201, answer.text
    return list(answer.json())


def test_the_number_of_statements_does_not_grow_with_the_number_of_links(
    client: Any, experimenter: Admin, study: StudyInDatabase
) -> None:
    services = client.app.state.services
    with statements(services) as few:
        made(experimenter, kind="personal", count=2)
    with statements(services) as many:
        links = made(experimenter, kind="personal", count=1200)
    assert len(links) == 1200
    # PostgreSQL takes a thousand rows per statement.
    assert len(many) <= len(few) + 2
    assert len({link["url"] for link in links}) == 1200


def test_links_are_listed_a_page_at_a_time(experimenter: Admin, study: StudyInDatabase) -> None:
    links = made(experimenter, kind="personal", count=7, label="S")
    person = Participant(experimenter.client, links[3]["url"].rpartition("/")[2])
    assert person.start().status_code == 201
    seen, after = [], None
    while True:
        page = experimenter.get(LINKS, params={"limit": 3} | ({"after": after} if after else {})).json()
        assert page["total"] == 8  # the study's general link comes first
        seen += page["links"]
        after = page["next"]
        if after is None:
            break
    assert [link["label"] for link in seen[1:]] == [f"S{number:03d}" for number in range(1, 8)]
    assert [link["runs"] for link in seen[1:]] == [0, 0, 0, 1, 0, 0, 0]


def test_an_unknown_place_to_go_on_from_is_said(experimenter: Admin, study: StudyInDatabase) -> None:
    answer = experimenter.get(LINKS, params={"after": "nothing"})
    assert answer.status_code == 404
    assert "There is no link 'nothing'" in answer.json()["error"]["message"]
