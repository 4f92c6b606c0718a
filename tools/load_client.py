"""Simulated raters on asyncio for `make load`: many at once from one process, every answer timed."""

from __future__ import annotations

import asyncio
import json
import random
import time
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from server.rehearsals.person import Person, Rater
from tools.load_connection import Connection

RETRY_S = 0.2
LONGEST_PAUSE_S = 5.0
GIVE_UP_S = 1800.0
"""A bound for the whole program, far beyond any wait: a page tries as long as it has answers to send."""
NEEDED = ("trial_index", "kind", "check", "plays_done", "prompt", "clips", "clip_sha256", "frames", "fps")


@dataclass
class Tally:
    """What the raters saw."""

    start_ms: list[float] = field(default_factory=list)
    rating_ms: list[float] = field(default_factory=list)
    rating_at: list[float] = field(default_factory=list)
    clip_ms: list[float] = field(default_factory=list)
    acknowledged: dict[str, int | None] = field(default_factory=dict)
    failed_starts: int = 0
    retries: int = 0
    given_up: int = 0


def percentile(values: Sequence[float], share: float) -> float:
    """The value below which `share` of them lie; not a number where there is none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else float("nan")


class LoadRater:
    """One rater: begins a visit, then rates at a steady pace until told to stop."""

    def __init__(self, port: int, link: str, number: int, tally: Tally) -> None:
        self.connection, self.link, self.tally = Connection(port), link, tally
        self.person = Person(None, Rater(number, 1, {}))  # type: ignore[arg-type]
        self.rng = random.Random(number)
        self.trials: list[dict[str, Any]] = []
        self.declared: dict[str, Any] = {}

    async def begin(self) -> None:
        """Start the run; counted as failed where it is not."""
        body = {"language": "en", "client_id": str(uuid.uuid4()), "device": {"simulated": True}}
        began = time.perf_counter()
        try:
            status, content = await self.connection.call("POST", f"/api/links/{self.link}/runs", body)
        except OSError:
            status, content = 599, b""
        self.tally.start_ms.append(1000 * (time.perf_counter() - began))
        if status != 201:
            self.tally.failed_starts += 1
            return
        self.connection.token = json.loads(content)["run_token"]

    async def prepare(self) -> None:
        """Consent, and the list of trials."""
        if self.connection.token:
            await self.insist("PUT", "/api/run/consent", {"agreed": True})
            state = json.loads((await self.insist("GET", "/api/run"))[1])
            self.declared = state["trial"]
            # Thousands of raters are in this process: what they do not need is let go.
            self.trials = [{name: trial[name] for name in NEEDED} for trial in state["trials"]]

    async def rate_until(self, end: float, every_s: float) -> None:
        """One clip and one rating each `every_s` seconds, out of step with the others."""
        due = time.monotonic() + self.rng.uniform(0, every_s)
        for trial in self.trials:
            if due >= end:
                break
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            await self._one(trial)
            due += every_s
        self.connection.close()

    async def _one(self, trial: dict[str, Any]) -> None:
        if trial["clip_sha256"]:
            began = time.perf_counter()
            await self.insist("GET", f"/clips/{trial['clip_sha256']}.mp4", keep=False)
            self.tally.clip_ms.append(1000 * (time.perf_counter() - began))
        rating_id = str(uuid.uuid4())
        body = self.person.rating(trial, self.declared)
        began = time.perf_counter()
        status, _ = await self.insist("PUT", f"/api/run/ratings/{rating_id}", body, keep=False)
        self.tally.rating_at.append(began)
        self.tally.rating_ms.append(1000 * (time.perf_counter() - began))
        if status in (200, 201):
            answer = body["answer"]
            is_check = answer["kind"] == "check"
            given = answer["check"] if is_check else answer["answers"]["rating"]["response"]
            self.tally.acknowledged[rating_id] = given

    async def insist(
        self, method: str, path: str, body: Any = None, *, keep: bool = True
    ) -> tuple[int, bytes]:
        """As a page does: the same request again until it is answered by less than 500, pausing longer."""
        ends, pause = time.monotonic() + GIVE_UP_S, RETRY_S
        while time.monotonic() < ends:
            try:
                status, content = await self.connection.call(method, path, body, keep=keep)
                if status < 500:
                    return status, content
            except OSError:
                pass
            self.tally.retries += 1
            await asyncio.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE_S)
        self.tally.given_up += 1
        return 599, b""
