"""Pairs chosen by the stored comparisons, through the API: what counts, what a page keeps."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.models import Study, StudyRun
from server.participation.run_repository import compared_answers
from tests.helpers.studies import Participant, StudyInDatabase, add_study
from tests.server.trials.test_comparisons import PAIRS, compare, mains

TEXT = PAIRS.replace("repeats = 2", "repeats = 1").replace(
    'pairs = { among = "within", factor = "character" }',
    'pairs = { among = "all" }\ndealing = { by = "active", random_share = 0.0 }\npairs_per_person = 3',
)
LEASE_MINUTES = 60


@pytest.fixture
def chosen(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", TEXT)


def counted(services: Services) -> Counter[str | None]:
    """Comparisons that a choice would rest on, by their answer."""
    from datetime import timedelta

    with services.database.read() as session:
        version = session.query(Study).one().versions[0].id
        rows = compared_answers(session, version, "participant", timedelta(minutes=LEASE_MINUTES))
    assert rows == sorted(rows, key=lambda row: (row.left, row.right, row.winner or ""))
    counts: Counter[str | None] = Counter()
    for row in rows:
        counts[row.winner] += row.times
    return counts


def clips_of(trials: list[Any]) -> list[list[str]]:
    return [[clip["clip_sha256"] for clip in trial["clips"]] for trial in trials]


def test_what_is_answered_and_what_is_under_way_both_count(
    client: TestClient, chosen: StudyInDatabase, services: Services
) -> None:
    first = Participant(client, chosen.link_token).agree()
    trials = mains(first)
    assert len(trials) == 3
    assert counted(services) == {None: 3}
    assert compare(first, trials[0], "left").status_code == 201
    assert compare(first, trials[1], "tie").status_code == 201
    assert counted(services) == {"left": 1, "tie": 1, None: 1}
    # A play that failed is not an answer; a visit given up, excluded or of another origin does not count.
    compare(first, trials[2], "right", playback={"method": "none"})
    assert counted(services)["right"] == 0
    Participant(client, chosen.link("preview")).agree()
    assert sum(counted(services).values()) == 3
    with services.database.write() as session:
        session.query(StudyRun).filter_by(origin="participant").update({"excluded": True})
    assert counted(services) == {}


def test_the_next_person_gets_other_pairs_and_a_page_keeps_its_own(
    client: TestClient, chosen: StudyInDatabase
) -> None:
    first = Participant(client, chosen.link_token).agree()
    dealt = clips_of(mains(first))
    second = Participant(client, chosen.link_token).agree()
    asked = [{tuple(sorted(pair)) for pair in pairs} for pairs in (dealt, clips_of(mains(second)))]
    # Twelve pairs of four cells: three that span them are under way, so none of them is asked again.
    assert not asked[0] & asked[1]
    for trial in mains(second):
        assert compare(second, trial, "left").status_code == 201
    assert clips_of(mains(first)) == dealt


def test_two_people_who_begin_at_once_are_not_dealt_the_same(
    client: TestClient, chosen: StudyInDatabase
) -> None:
    from concurrent.futures import ThreadPoolExecutor

    people = [Participant(client, chosen.link_token) for _ in range(2)]
    with ThreadPoolExecutor(2) as pool:
        assert {answer.status_code for answer in pool.map(lambda one: one.start(), people)} == {201}
    times = Counter(tuple(sorted(pair)) for one in people for pair in clips_of(mains(one)))
    assert sum(times.values()) == len(times) == 6
