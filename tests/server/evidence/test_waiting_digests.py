"""Digests of clips that the server had not read yet are judged before the run is."""

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from sqlalchemy import select

from server.context import Services
from server.core.storage import ClipsAway, ClipStore
from server.models import AnswerEvidence, RunEvent, StudyRun
from server.participation.clip_hashes import ClipHashes
from server.participation.judgement import digests_judged_later, judge_later
from tests.helpers.evidence import Watcher
from tests.helpers.waiting import run_in_own_loop
from tests.server.evidence.conftest import CLIP_S

WRONG = "0" * 64


class SlowStore:
    """An object store that answers nothing until the test releases it, and may be away."""

    def __init__(self, store: ClipStore) -> None:
        self.store, self.answers, self.is_away = store, threading.Event(), False

    def read(self, sha256: str, begin: int, end: int) -> Iterator[bytes]:
        self.answers.wait(60)
        if self.is_away:
            raise ClipsAway("the store is away")
        yield from self.store.read(sha256, begin, end)


@pytest.fixture
def slow(services: Services) -> Iterator[SlowStore]:
    """The server's clips lie in a slow store; to be named before `watcher`."""
    store = SlowStore(services.clips)
    services.intake.clips = ClipHashes(store)  # type: ignore[arg-type]
    yield store
    store.answers.set()
    services.intake.clips.close()


def answered(watcher: Watcher, *first: dict[str, Any]) -> None:
    """Answer everything as people vary, the first trials with clips by these changes of their evidence."""
    watcher.request("PUT", "/forms/about", {"answers": {"age": 30, "glasses": ["lenses"]}})
    changes = list(first)
    for trial in watcher.state()["trials"]:
        watcher.wait(CLIP_S + 1)
        change = changes.pop(0) if changes and trial["clip_sha256"] else {}
        asked = [int(word) for word in (trial["prompt"] or "").replace("*", " ").split() if word.isdigit()]
        number = trial["trial_index"]
        varied = {"response": asked[0] if asked else 3 * number % 7 + 1, "rt": 400.0 + 60 * number}
        pressed = {"presses": 2, "trusted": 2, "press_ms": 80.0 + 5 * number, "moves": 5}
        said = watcher.answer(trial, watcher.evidence(trial, interaction=pressed) | change, **varied)
        assert said.status_code == 201


def judged(services: Services) -> list[bool | None]:
    """What was found of each digest of a clip, in the order of the answers."""
    query = select(AnswerEvidence).where(AnswerEvidence.clip_ms > 0)
    with services.database.read() as session:
        return [row.digest_right for row in session.scalars(query.order_by(AnswerEvidence.trial_index))]


def verdict(services: Services) -> str | None:
    with services.database.read() as session:
        return session.scalars(select(StudyRun.evidence_verdict)).one()


def test_what_was_answered_before_its_clip_was_read_is_judged_at_the_end(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    answered(watcher, {}, {"digest": WRONG})
    assert judged(services) == [None] * 10
    slow.answers.set()
    assert watcher.request("POST", "/complete").status_code == 200
    assert judged(services) == [True, False] + [True] * 8
    assert verdict(services) == "unclear"


def test_a_store_that_is_away_keeps_nobody_from_the_end(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    slow.is_away = True
    slow.answers.set()
    answered(watcher)
    assert watcher.request("POST", "/complete").status_code == 200
    assert judged(services) == [None] * 10


def test_a_visit_that_is_broken_off_is_judged_as_well(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    trials = [trial for trial in watcher.state()["trials"] if trial["clip_sha256"]]
    watcher.wait(CLIP_S + 1)
    assert watcher.answer(trials[0], watcher.evidence(trials[0]) | {"digest": WRONG}).status_code == 201
    slow.answers.set()
    assert watcher.request("POST", "/withdraw").status_code == 200
    assert judged(services) == [False]


def test_a_run_that_is_over_is_not_judged_again_by_asking(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    """Nobody makes the server read clips by asking once more."""
    slow.is_away = True
    slow.answers.set()
    answered(watcher)
    assert watcher.request("POST", "/complete").status_code == 200
    slow.is_away = False
    watcher.request("POST", "/complete")
    watcher.request("POST", "/withdraw")
    assert judged(services) == [None] * 10


def noted(services: Services) -> list[Any]:
    """What was said of digests that were judged after the end."""
    query = select(RunEvent.data).where(RunEvent.type == "digests_checked").order_by(RunEvent.id)
    with services.database.read() as session:
        return list(session.scalars(query))


def test_a_store_that_comes_back_lets_every_digest_be_judged(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    slow.is_away = True
    slow.answers.set()
    answered(watcher, {}, {"digest": WRONG})
    assert watcher.request("POST", "/complete").status_code == 200
    assert verdict(services) == "likely"
    assert judge_later(services.database, services.intake.clips) == 10
    assert (judged(services), noted(services), verdict(services)) == ([None] * 10, [], "likely")
    slow.is_away = False
    assert judge_later(services.database, services.intake.clips) == 0
    assert judged(services) == [True, False] + [True] * 8
    assert verdict(services) == "unclear"
    assert noted(services) == [{"answers": 10, "wrong": 1, "before": "likely", "verdict": "unclear"}]
    assert judge_later(services.database, services.intake.clips) == 0
    assert len(noted(services)) == 1


def test_of_several_workers_one_judges_and_notes_it(
    slow: SlowStore, watcher: Watcher, services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second has read the same digests as waiting, and stores what it made of them after the first."""
    slow.is_away = True
    slow.answers.set()
    answered(watcher, {}, {"digest": WRONG})
    assert watcher.request("POST", "/complete").status_code == 200
    slow.is_away = False
    second = ClipHashes(slow)  # type: ignore[arg-type]
    hash_now, ahead = second.hash_now, [services.intake.clips]

    def after_the_first(sha256: str, size: int, limit: float) -> bytes | None:
        while ahead:
            assert judge_later(services.database, ahead.pop()) == 0
        return hash_now(sha256, size, limit)

    monkeypatch.setattr(second, "hash_now", after_the_first)
    assert judge_later(services.database, second) == 0
    assert judged(services) == [True, False] + [True] * 8
    assert noted(services) == [{"answers": 10, "wrong": 1, "before": "likely", "verdict": "unclear"}]


def test_a_run_that_goes_on_is_judged_without_a_verdict(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    trials = [trial for trial in watcher.state()["trials"] if trial["clip_sha256"]]
    watcher.wait(CLIP_S + 1)
    assert watcher.answer(trials[0], watcher.evidence(trials[0]) | {"digest": WRONG}).status_code == 201
    slow.answers.set()
    assert judge_later(services.database, services.intake.clips) == 0
    assert (judged(services), noted(services), verdict(services)) == ([False], [], None)


def test_each_clip_of_a_store_that_is_away_is_asked_for_once_a_look(
    slow: SlowStore, watcher: Watcher, services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow.is_away = True
    slow.answers.set()
    answered(watcher)
    asked: list[str] = []

    def gone(sha256: str, begin: int, end: int) -> Iterator[bytes]:
        asked.append(sha256)
        raise ClipsAway("the store is away")

    monkeypatch.setattr(slow, "read", gone)
    assert judge_later(services.database, services.intake.clips) == 10
    assert len(asked) == len(set(asked))


def test_the_server_judges_by_itself_once_the_store_is_back(
    slow: SlowStore, watcher: Watcher, services: Services
) -> None:
    slow.is_away = True
    slow.answers.set()
    answered(watcher, {"digest": WRONG})
    assert watcher.request("POST", "/complete").status_code == 200

    async def serve() -> None:
        async with digests_judged_later(services.database, services.intake, look_every_s=0.05):
            while services.intake.unchecked.is_set():  # the first look finds the store away
                await asyncio.sleep(0.02)
            slow.is_away = False
            while judged(services) != [False] + [True] * 9 or verdict(services) == "likely":
                await asyncio.sleep(0.02)

    run_in_own_loop(asyncio.wait_for(serve(), 120))
