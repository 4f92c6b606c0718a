"""Two server processes on one PostgreSQL: chosen pairs and adaptive series are neither doubled nor lost."""

import os
import signal
import subprocess
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import text

from server.context import Services
from server.core.settings import Settings
from server.participation import series, series_repository
from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.helpers.comparisons import comparisons
from tests.helpers.ports import free_port
from tests.helpers.studies import SHORT, add_study
from tests.helpers.thresholds import YES_NO, text_with, thresholds
from tests.server.participants.test_choosing import TEXT as CHOSEN
from tests.server.test_durability import start

PEOPLE = 4


class InTurn:
    """A client whose requests go to the workers in turn; answers are sent a second time, to the other."""

    def __init__(self, addresses: tuple[str, ...], first: int) -> None:
        self._clients = [JsonClient(address) for address in addresses]
        self._next = first
        self.again: Counter[int] = Counter()

    @property
    def token(self) -> str:
        return self._clients[0].token

    @token.setter
    def token(self, token: str) -> None:
        for client in self._clients:
            client.token = token

    def _client(self) -> JsonClient:
        self._next += 1
        return self._clients[self._next % len(self._clients)]

    def get(self, path: str) -> Any:
        return self._client().get(path)

    def post(self, path: str, body: Any = None) -> Any:
        return self._client().post(path, body)

    def put(self, path: str, body: Any = None) -> Any:
        answer = self._client().put(path, body)
        if "/ratings/" in path:
            status, _ = self._client().call("PUT", path, body)
            self.again[status] += 1
        return answer

    def close(self) -> None:
        for client in self._clients:
            client.close()


@pytest.fixture
def workers(services: Services, settings: Settings) -> Iterator[tuple[str, ...]]:
    """The addresses of two servers that share a database and a data folder."""
    if services.database.is_sqlite:
        pytest.skip("several workers need PostgreSQL")
    services.database.engine.dispose()
    started: list[tuple[int, subprocess.Popen[bytes]]] = []
    try:
        for _ in range(2):
            port = free_port()
            started.append((port, start(settings, port)))
        yield tuple(f"http://127.0.0.1:{port}" for port, _ in started)
    finally:
        for _, process in started:
            os.killpg(process.pid, signal.SIGTERM)
        for _, process in started:
            process.wait(30)


def test_two_workers_choose_pairs_and_follow_series_as_one(
    services: Services, tmp_path: Path, workers: tuple[str, ...]
) -> None:
    pairs = add_study(services, tmp_path / "pairs", CHOSEN)
    adaptive = add_study(services, tmp_path / "series", text_with(SHORT, YES_NO), name="adaptive")
    links = [study.link(synthetic=True) for study in (pairs, adaptive)] * PEOPLE
    with ThreadPoolExecutor(2) as pool:
        dealt = list(pool.map(lambda worker: _dealt(workers[worker], links[0], 100 + worker), range(2)))
    assert len(dealt[0] | dealt[1]) == 6, "who begins at once at two workers gets other pairs"

    def takes_part(number: int) -> Counter[int]:
        client = InTurn(workers, number)
        person = Person(client, Rater(number, 1, {}))  # type: ignore[arg-type]
        assert person.take_part(links[number])
        client.close()
        return client.again

    with ThreadPoolExecutor(2 * PEOPLE) as pool:
        again = sum(pool.map(takes_part, range(2 * PEOPLE)), Counter[int]())
    assert set(again) == {200}, "an answer sent again to the other worker is known there"
    _check_pairs(services)
    _check_series(services)


def _dealt(address: str, link: str, seed: int) -> set[frozenset[str]]:
    """The pairs of a run that is begun now."""
    client = JsonClient(address)
    Person(client, Rater(seed, 1, {})).begin(link)
    client.put("/api/run/consent", {"agreed": True})
    trials = client.get("/api/run")["trials"]
    client.close()
    pairs = (trial["clips"] for trial in trials if trial["kind"] == "main")
    return {frozenset(clip["clip_sha256"] for clip in clips) for clips in pairs}


def _check_pairs(services: Services) -> None:
    with services.database.read() as session:
        rows = [row for row in comparisons(session) if row["kind"] == "main"]
    firsts = [row for row in rows if row["play"] == 1]
    assert set(Counter(row["run"] for row in firsts).values()) == {3}
    assert len(firsts) == 3 * PEOPLE
    for run in {row["run"] for row in firsts}:
        own = [(row["left_stimulus"], row["right_stimulus"]) for row in firsts if row["run"] == run]
        assert len(set(map(frozenset, own))) == 3


def _check_series(services: Services) -> None:
    with services.database.read() as session:
        rows = [row for row in thresholds(session) if row["counts"]]
        loaded = services.versions.get(session, 2)
        for run in session.execute(text("SELECT id, public_id FROM study_runs WHERE version_id = 2")):
            connection = session.connection()
            trials = series_repository.trials(connection, run.id)
            answers = series_repository.answers(connection, run.id)
            assert Counter((row.series, row.number) for row in answers).most_common(1)[0][1] == 1
            for name in ("s1", "s2"):
                numbers = [row.number for row in answers if row.series == name]
                assert numbers == list(range(1, len(numbers) + 1))
                assert len(numbers) >= 7
            # Computed again from nothing, everything is as the two workers wrote it in turn.
            bare = [SimpleNamespace(**{**row._mapping, "threshold": None}) for row in answers]
            outlook = series.outlook_after(loaded, trials, bare)
            for row in answers:
                estimate = outlook.estimates[row.trial_index, row.play]
                assert row.threshold == pytest.approx(estimate.threshold)
                assert row.entropy == pytest.approx(estimate.entropy)
            mine = [row for row in rows if row["run"] == run.public_id]
            assert len(mine) == len(answers)
            assert all(row["threshold"] is not None for row in mine)
