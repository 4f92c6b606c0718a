"""What simulated people need within this process: a way to the server, and the levels of the clips."""

from collections.abc import Iterable
from typing import Any

from fastapi.testclient import TestClient

from server.context import Services
from server.rehearsals.person import Person, Rater, observer_of
from tests.helpers.studies import StudyInDatabase


class Api:
    """Requests to a server within this process; an answer without success fails the test."""

    token: str | None = None

    def __init__(self, client: TestClient) -> None:
        self._client = client

    def get(self, path: str) -> Any:
        return self._send("GET", path)

    def put(self, path: str, body: Any) -> Any:
        return self._send("PUT", path, body)

    def post(self, path: str, body: Any = None) -> Any:
        return self._send("POST", path, body)

    def _send(self, method: str, path: str, body: Any = None) -> Any:
        headers = {"authorization": f"Bearer {self.token}"} if self.token else {}
        answer = self._client.request(method, path, json=body, headers=headers)
        assert answer.status_code < 300, answer.text
        return answer.json()


def levels_by_clip(services: Services) -> dict[str, dict[str, str]]:
    """Levels of each clip of the first version, by hash."""
    with services.database.read() as session:
        version = services.versions.get(session, 1)
        names = version.experiment.factor_names
        return {
            version.clips[ident].sha256: dict(zip(names, cell.split("/"), strict=True))
            for (cell, _), ident in version.places.items()
        }


def take_part(
    client: TestClient, study: StudyInDatabase, truth: str, seeds: Iterable[int] = (1,), effects_seed: int = 1
) -> None:
    """Have simulated people of this true function go through a study of thresholds, a person per seed."""
    levels = levels_by_clip(study.services)
    seen, link = observer_of(study.experiment, levels, truth), study.link(synthetic=True)
    for seed in seeds:
        assert Person(Api(client), Rater(seed, effects_seed, levels, seen)).take_part(link)
