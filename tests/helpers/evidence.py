"""A participant whose answers carry evidence, at times that the test says."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any

import pytest

from server.context import SIMULATED_TIME, Services, open_services
from server.core.settings import Settings
from server.core.values import now
from server.participation.clip_hashes import clip_digest, clip_hash
from tests.helpers.studies import Participant, clip_url


@pytest.fixture
def services(settings: Settings) -> Iterator[Services]:
    """A server that refuses what cannot be, and takes the time from the requests."""
    opened = open_services(settings.model_copy(update={"evidence": "refuse"}), rehearses=True)
    yield opened
    opened.intake.clips.close()
    opened.database.close()


class Watcher(Participant):
    """A participant as the page is one: fetches clips, has tickets, and a clock that the test moves."""

    moment: datetime
    tickets: Any

    def request(self, method: str, path: str, body: Any = None) -> Any:
        """A request with the run token, at this participant's moment."""
        headers = {"authorization": f"Bearer {self.token}", SIMULATED_TIME: self.moment.isoformat()}
        return self.client.request(method, f"/api/run{path}", json=body, headers=headers)

    def begin(self, **told: Any) -> "Watcher":
        """Begin, agree and take the tickets; `told` is said of the page."""
        self.moment = now()
        assert self.start(evidence=True, **told).status_code == 201
        assert self.request("PUT", "/consent", {"agreed": True}).status_code == 200
        self.state()
        return self

    def state(self) -> Any:
        """GET /api/run; its tickets are kept."""
        state = self.request("GET", "").json()
        self.tickets = state["tickets"]
        return state

    def wait(self, seconds: float) -> None:
        """Let time go by."""
        self.moment += timedelta(seconds=seconds)

    def evidence(self, trial: Any, play: int = 1, **changes: Any) -> dict[str, Any]:
        """What the page sends with this rating; `changes` replace parts."""
        ticket = self.tickets["by_trial"][trial["trial_index"]][play - 1]
        digest = (
            clip_digest(ticket, clip_hash(self.client.get(clip_url(trial)).content))
            if trial["clip_sha256"]
            else None
        )
        interaction = {"presses": 2, "trusted": 2, "press_ms": 90.0, "moves": 5}
        return {
            "batch": self.tickets["batch"],
            "ticket": ticket,
            "digest": digest,
            "interaction": interaction,
        } | changes

    def answer(self, trial: Any, evidence: Any = "whole", **changes: Any) -> Any:
        """Rate a trial; returns the response."""
        given = self.evidence(trial, changes.get("play", 1)) if evidence == "whole" else evidence
        return self.rate(trial, evidence=given, answered_at_client=self.moment.isoformat(), **changes)
