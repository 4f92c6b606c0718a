"""Results are counted when something changed, and never answered with what an exclusion has made untrue."""

import threading
import time
from typing import Any

import pytest

from server.context import Services
from server.results import cache, kinds, service
from server.results.cache import ResultsCache, Revision
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant

RESULTS = "/studies/short/results"


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """One entry for every time the real results were counted."""
    done: list[str] = []
    real = service.results

    def noted(*asked: Any) -> Any:
        done.append(asked[3].origin)
        return real(*asked)

    monkeypatch.setattr(service, "results", noted)
    return done


def test_a_page_that_asks_again_costs_no_count(
    viewer: Admin, participant: Participant, counts: list[str]
) -> None:
    participant.agree().rate_all()
    first = viewer.get(RESULTS)
    again = viewer.get(RESULTS, headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert viewer.get(RESULTS).json() == first.json()
    assert counts == ["participant"]


def test_every_change_is_counted(experimenter: Admin, participant: Participant, counts: list[str]) -> None:
    participant.agree()
    trials = participant.state()["trials"]
    for trial in trials[:-2]:
        participant.rate(trial)
    run = f"/studies/short/runs/{participant.run_id}"

    def shown() -> tuple[int, int]:
        answer = experimenter.get(RESULTS).json()
        return answer["participants"], answer["ratings"]

    before = shown()
    for trial in trials[-2:]:  # at most one is a check, since a block has one
        participant.rate(trial)
    assert shown()[1] in (before[1] + 1, before[1] + 2)
    assert len(counts) == 2
    experimenter.send("PUT", f"{run}/exclusion", {"reason": "asleep"})
    assert shown() == (0, 0)
    experimenter.send("DELETE", f"{run}/exclusion")
    assert shown()[0] == 1
    experimenter.send("POST", f"{run}/erase", {"confirm": participant.run_id})
    assert shown() == (0, 0)
    assert len(counts) == 5


def test_results_of_many_answers_are_counted_before_anybody_asks(
    services: Services,
    viewer: Admin,
    participant: Participant,
    counts: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    participant.agree().rate_all()
    kept = viewer.client.app.state.services.results  # type: ignore[attr-defined]
    kinds.count_ahead(services.database, kept, lambda: False)
    assert counts == []  # so few are counted while a page loads
    monkeypatch.setattr(kinds, "MANY_ANSWERS", 1)
    kinds.count_ahead(services.database, kept, lambda: True)
    assert counts == []  # the server stops
    kinds.count_ahead(services.database, kept, lambda: False)
    assert counts == ["participant"]
    assert viewer.get(RESULTS).json()["participants"] == 1
    assert counts == ["participant"]


class Slow:
    """Counting that takes a given time, on its own clock."""

    def __init__(self) -> None:
        self.now, self.done, self.revision = 0.0, 0, Revision((1,), (1,))
        self.finished = threading.Event()
        self.cache = ResultsCache(lambda: self.now)

    def count(self) -> Any:
        self.now += 3.0
        self.done += 1
        self.finished.set()
        return self.revision, f"counted {self.done}"

    def get(self) -> Any:
        return self.cache.get((1, "participant", 1), self.revision, self.count).results


def test_slow_counting_goes_on_behind_the_page_and_not_all_the_time() -> None:
    slow = Slow()
    assert slow.get() == "counted 1"
    slow.revision = Revision((1,), (2,))
    assert slow.get() == "counted 1"  # just counted
    assert slow.done == 1
    slow.now += 3.0 * cache.PAUSE + 1
    slow.finished.clear()
    assert slow.get() == "counted 1"
    assert slow.finished.wait(60)
    until = time.monotonic() + 60
    while slow.get() != "counted 2":
        assert time.monotonic() < until
        time.sleep(0.01)
    assert slow.done == 2


def test_a_decision_is_never_answered_with_older_results() -> None:
    slow = Slow()
    assert slow.get() == "counted 1"
    slow.revision = Revision((2,), (1,))
    assert slow.get() == "counted 2"
