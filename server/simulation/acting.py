"""A simulated person with a manner: sends evidence, at times of a clock of its own."""

import random
import uuid
from datetime import datetime, timedelta
from typing import Any

from experiments.trials.clip_rating.page import ShownClipRating
from server.clips.address import clip_address
from server.clock import now
from server.context import SIMULATED_TIME
from server.evidence.clip_bytes import clip_digest, clip_hash
from server.simulation.http import JsonClient, Refused
from server.simulation.manners import Manner, person
from server.simulation.person import SEES_MOTION, Person, Rater, still_due, view_s

MAX_HELD = 12
"""Answers kept while the network is away."""
OFFLINE_S, READY_S = 600.0, 0.8
MAX_ROUNDS = 8


class Actor(Person):
    """One participant who takes part in a declared manner; `refused` holds the codes of refusals."""

    client: JsonClient

    def __init__(self, client: JsonClient, rater: Rater, manner: Manner, clips: dict[str, bytes]) -> None:
        super().__init__(client, rater)
        self.manner, self.clips = manner, clips
        self.rng = random.Random(f"{rater.effects_seed}/manner/{rater.seed}")
        self.person = person(self.rng)
        self.moment: datetime = now()
        self.clock_off = timedelta()
        self.refused: list[str] = []
        self.warned: list[str] = []
        self.ended = False
        self.run_id = ""
        self.tickets: dict[str, Any] | None = None
        self.offers_other_way = False
        self._held: list[tuple[dict[str, Any] | None, dict[str, Any]]] = []
        self._holds = 0

    def visit(self, link_token: str) -> str | None:
        """Go through the whole run; return the code, None where an answer ended it or some were refused."""
        self.brings_evidence = self.manner.tickets
        self.begin(link_token)
        state = self._state()
        self.run_id = state["run_id"]
        if not self._before(state):
            return None
        if self.placed is not None:
            state, self.tickets = self.placed, self.placed["tickets"]
        for _ in range(MAX_ROUNDS):
            due = [trial for trial in state["trials"] if not trial["answered"]]
            if not due or self._is_over():
                break
            self.following = None
            while due:
                self.rate(due.pop(0), state["trial"])
                due = still_due(due, self.following)
            self._deliver()
            state = self._state()
        if self._is_over() or not self._forms(state, "after"):
            return None
        self.client.put("/api/run/stage", {"stage": "debrief"})
        return str(self.client.post("/api/run/complete")["completion_code"])

    def _is_over(self) -> bool:
        return bool(self.refused) or self.ended

    def _state(self) -> dict[str, Any]:
        self._tell_time()
        state: dict[str, Any] = self.client.get("/api/run")
        self.tickets = state["tickets"]
        self.offers_other_way = bool(state["checks"] and state["checks"]["other_way"])
        return state

    def rate(self, trial: dict[str, Any], declared: dict[str, Any]) -> bool:
        """Watch and answer one trial; whether it is asked again shows when the run is read anew."""
        manner, clips_s = self.manner, view_s(trial, declared)
        self._mishaps()
        rt = manner.rt_ms(self.rng, self.person)
        if manner.waits:
            self.moment += timedelta(seconds=clips_s + rt / 1000 + READY_S)
        body = self.rating(trial, declared) | {"rt": round(rt, 2)}
        if body["answer"]["kind"] == "clip_rating":  # other kinds are answered as the rater model does
            self._answer_in_manner(body["answer"]["answers"], trial, declared)
        if body["answer"]["kind"] == "check":
            body |= self._checked(trial)
        body["answered_at_client"] = (self.moment + self.clock_off).isoformat()
        if manner.tickets:
            body["evidence"] = self._evidence(trial)
        self._held.append((self._view(trial, body, clips_s), body))
        chosen_by_answers = "ahead" in declared
        if self._holds == 0 or len(self._held) >= MAX_HELD or chosen_by_answers:
            self._deliver()
        else:
            self._holds -= 1
        return False

    def _mishaps(self) -> None:
        rng, manner = self.rng, self.manner
        if rng.random() < manner.offline:
            self._holds = rng.randint(2, MAX_HELD)
        if rng.random() < manner.clock_jumps:
            self.clock_off = timedelta(hours=rng.uniform(-30, 30))
        if rng.random() < manner.reloads and not self._holds:
            self._deliver()
            self._state()

    def _answer_in_manner(
        self, answers: dict[str, dict[str, Any]], trial: dict[str, Any], declared: dict[str, Any]
    ) -> None:
        told = ShownClipRating.model_validate(declared)
        if trial["kind"] == "attention" and self.manner.reads:
            return
        asked = (told.check_scale,) if trial["kind"] == "attention" else told.scales
        for scale in (one.rated("") for one in asked):
            if self.manner.answers == "same":
                answers[scale.name] = {"response": scale.nearest((scale.minimum + scale.maximum) / 2)}
            elif self.manner.answers == "any" or trial["kind"] == "attention":
                drawn = self.rng.uniform(scale.minimum - scale.step / 2, scale.maximum + scale.step / 2)
                answers[scale.name] = {"response": scale.nearest(drawn)}

    def _checked(self, trial: dict[str, Any]) -> dict[str, Any]:
        """What this manner makes of a motion check: seen, guessed, or gone around where that is offered."""
        if self.manner.checks == "goes around" and self.offers_other_way:
            answer = {"kind": "check", "check": None, "other_way": True}
            return {"answer": answer, "playback": {"method": "none"}}
        sees = SEES_MOTION if self.manner.checks == "sees" else 0.0
        return {"answer": {"kind": "check", "check": self.rater.check_answer(trial, self.rng, sees)}}

    def _evidence(self, trial: dict[str, Any]) -> dict[str, Any] | None:
        if self.tickets is None:
            return None
        ticket = self.tickets["by_trial"][trial["trial_index"]][trial["plays_done"]]
        digest = None
        if trial["clip_sha256"] and self.manner.fetches:
            clips = (self._clip(clip["clip_sha256"]) for clip in trial["clips"])
            digest = clip_digest(ticket, *map(clip_hash, clips))
        interaction = self.manner.interaction(self.rng, self.person)
        return {
            "batch": self.tickets["batch"],
            "ticket": ticket,
            "digest": digest,
            "interaction": interaction,
        }

    def _view(self, trial: dict[str, Any], body: dict[str, Any], clips_s: float) -> dict[str, Any] | None:
        """The view of a trial that has ended; None from who sends no tickets, and where nothing was shown."""
        evidence = body.get("evidence")
        if evidence is None or not trial["clip_sha256"]:
            return None
        began = self.moment + self.clock_off
        if self.manner.waits:
            began -= timedelta(seconds=clips_s + body["rt"] / 1000)
        return {
            "id": str(uuid.uuid4()),
            "trial_index": trial["trial_index"],
            "number": trial["plays_done"] + 1,
            "play": trial["plays_done"] + 1,
            "started_at_client": began.isoformat(),
            "ended_at_client": body["answered_at_client"],
            "outcome": "shown",
            "evidence": {"batch": evidence["batch"], "ticket": evidence["ticket"]},
        }

    def _clip(self, sha256: str) -> bytes:
        if sha256 not in self.clips:
            self.clips[sha256] = self.client.fetch(clip_address(sha256))
        return self.clips[sha256]

    def _deliver(self) -> None:
        """Send what is held, after an absence of the network where it was away."""
        if len(self._held) > 1:
            self.moment += timedelta(seconds=OFFLINE_S)
        self._holds = 0
        self._tell_time()
        held, self._held = self._held, []
        for view, body in held:
            if self.ended:
                return
            try:
                if view is not None:
                    self.client.post("/api/run/views", {"views": [view]})
                saved = self.client.put(f"/api/run/ratings/{uuid.uuid4()}", body)
                self.ratings += 1
                self.following = saved.get("next")
                self._heed(saved["receipt"])
            except Refused as error:
                self.refused.append(error.code)

    def _heed(self, receipt: dict[str, Any]) -> None:
        """Read a warning, as the page shows it before the next trial, and see whether the run is over."""
        self.ended = receipt["status"] != "active"
        if receipt.get("warning") and not self.ended:
            self.warned.append(receipt["warning"]["rule"])
            event = {"id": str(uuid.uuid4()), "type": "warning_shown"}
            self.client.post("/api/run/events", {"events": [event]})

    def _tell_time(self) -> None:
        if self.manner.waits:
            self.client.headers[SIMULATED_TIME] = self.moment.isoformat()
