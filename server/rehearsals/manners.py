"""Manners of taking part, people's and programs', acted out through the real API."""

import json
import random
import uuid
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

from experiments.errors import InputError, did_you_mean
from experiments.kinds.clip_rating import ShownClipRating
from server.app import create_app
from server.cli_common import migrated_services
from server.context import SIMULATED_TIME
from server.core.db import Database
from server.core.repository import run_called
from server.core.settings import Settings
from server.core.storage import clip_address
from server.core.values import now
from server.participation.clip_hashes import clip_digest, clip_hash
from server.participation.evidence import VERDICTS
from server.participation.judgement import judge_run
from server.rehearsals.http import JsonClient, RefusedRequest, running_server
from server.rehearsals.person import SEES_MOTION, Person, Rater, still_due, view_s

# Manners of taking part: how people and programs act between two answers, seeded.
#
# Each is a model of a participant; the points of server/participation/evidence.py were set by them. A second
# set, written apart, tests them (tests/server/evidence).

Interaction = dict[str, Any]


@dataclass(frozen=True)
class Manner:
    """How somebody takes part.

    Attributes
    ----------
    rt_ms : callable
        Response time of one answer.
    interaction : callable
        Presses between two answers, None if none are given.
    tickets : bool
        Sends the server's tickets.
    fetches : bool
        Fetches clips, and shows it.
    waits : bool
        Lets the clips play.
    answers : {"model", "same", "any"}
        By the rater model, always the same, or any.
    reads : bool
        Does what attention checks ask.
    checks : {"sees", "guesses", "goes around"}
        What it makes of motion checks, in which single pictures show nothing.
    offline, reloads, clock_jumps : float
        Chances of each before an answer.
    """

    rt_ms: Callable[[random.Random, "Habits"], float]
    interaction: Callable[[random.Random, "Habits"], Interaction | None]
    tickets: bool = True
    fetches: bool = True
    waits: bool = True
    answers: Literal["model", "same", "any"] = "model"
    reads: bool = True
    checks: Literal["sees", "guesses", "goes around"] = "guesses"
    offline: float = 0.0
    reloads: float = 0.0
    clock_jumps: float = 0.0


@dataclass(frozen=True)
class Habits:
    """What stays the same over one person's visit: pace (median response time, spread) and hand."""

    rt_median_ms: float
    rt_sigma: float
    press_ms: float
    press_sd_ms: float


def person(rng: random.Random) -> Habits:
    """Somebody drawn at random."""
    return Habits(
        rt_median_ms=rng.lognormvariate(6.7, 0.3),
        rt_sigma=rng.uniform(0.25, 0.6),
        press_ms=rng.uniform(60, 140),
        press_sd_ms=rng.uniform(8, 30),
    )


def _human_rt(rng: random.Random, person: Habits) -> float:
    return person.rt_median_ms * rng.lognormvariate(0, person.rt_sigma)


def _slow_rt(rng: random.Random, person: Habits) -> float:
    return 3 * _human_rt(rng, person)


def _hasty_rt(rng: random.Random, _person: Habits) -> float:
    return rng.lognormvariate(5.3, 0.3)


def _plausible_rt(rng: random.Random, _person: Habits) -> float:
    return rng.uniform(500, 1500)


def _polling_rt(rng: random.Random, _person: Habits) -> float:
    return 250 + rng.uniform(0, 15)


def _hand(rng: random.Random, person: Habits) -> Interaction:
    presses = rng.choice((2, 2, 2, 3))
    length = max(20.0, rng.gauss(person.press_ms, person.press_sd_ms))
    return {"presses": presses, "trusted": presses, "press_ms": round(length, 1), "moves": rng.randrange(60)}


def _synthetic_click(_rng: random.Random, _person: Habits) -> Interaction:
    return {"presses": 2, "trusted": 0, "press_ms": None, "moves": 0}


def _driver(rng: random.Random, _person: Habits) -> Interaction:
    return {"presses": 2, "trusted": 2, "press_ms": round(rng.uniform(0.3, 1.5), 1), "moves": 2}


def _busy_driver(rng: random.Random, _person: Habits) -> Interaction:
    return {"presses": 2, "trusted": 2, "press_ms": round(rng.uniform(5, 60), 1), "moves": 2}


def _screen_reader(_rng: random.Random, _person: Habits) -> Interaction:
    return {"presses": 2, "trusted": 2, "press_ms": None, "moves": 0}


def _no_interaction(_rng: random.Random, _person: Habits) -> None:
    return None


MANNERS: dict[str, Manner] = {
    "http": Manner(_plausible_rt, _no_interaction, tickets=False, fetches=False, waits=False, answers="any"),
    "http-slow": Manner(_plausible_rt, _no_interaction),
    "script": Manner(_polling_rt, _synthetic_click, answers="any"),
    "frames": Manner(_human_rt, _driver),
    "flow": Manner(_human_rt, _driver, checks="sees"),
    "careless": Manner(_hasty_rt, _hand, checks="sees", answers="same", reads=False),
    "honest": Manner(_human_rt, _hand, checks="sees", offline=0.01, reloads=0.01, clock_jumps=0.01),
    "assistive": Manner(_slow_rt, _screen_reader, checks="goes around"),
    "scripted": Manner(_human_rt, _busy_driver, answers="any", reads=False),
}
"""http: plain HTTP. http-slow: HTTP with plausible waits and fetched clips. script: a headless browser whose
page a script clicks. frames: a driven browser that answers from single frames. flow: one that computes
optical flow, and so sees what motion checks show. careless: a person, fast and always the same. honest: a
person whose network fails, who reloads the page, or whose clock jumps. assistive: a screen reader.
scripted: a browser that a script clicks, on a machine whose other work lengthens its presses."""


# A simulated person with a manner: sends evidence, at times of a separate clock.

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
        """Watch and answer one trial; whether it is asked again shows when the run is read again."""
        manner, clips_s = self.manner, view_s(trial, declared)
        self._mishaps()
        rt = manner.rt_ms(self.rng, self.person)
        if manner.waits:
            self.moment += timedelta(seconds=clips_s + rt / 1000 + READY_S)
        body = self.rating(trial, declared) | {"rt": round(rt, 2)}
        if "answers" in body["answer"]:  # on scales; other answers are given as the rater model does
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
        """The view of a trial that has ended; None without tickets, and where nothing was shown."""
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
            except RefusedRequest as error:
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


# `server simulate --as`: a manner's runs through the real API, each with the verdict on it.


def manner_called(name: str) -> Manner:
    """The manner of this name; InputError where there is none."""
    if name not in MANNERS:
        raise InputError(f"--as: there is no behavior '{name}'{did_you_mean(name, MANNERS)}")
    return MANNERS[name]


def act(
    settings: Settings, link: str, raters: list[Rater], manner: Manner, at_once: int
) -> list[dict[str, Any]]:
    """Let each rater take part in this manner, held to what people are; return a record of each run."""
    held = settings.model_copy(update={"evidence": "refuse"})
    clips: dict[str, bytes] = {}

    def one(address: str, rater: Rater) -> Actor:
        client = JsonClient(address)
        actor = Actor(client, rater, manner, clips)
        try:
            actor.visit(link)
        except RefusedRequest as error:
            actor.refused.append(error.code)
        finally:
            client.close()
        return actor

    app = create_app(held, rehearses=True)
    with running_server(app) as address, ThreadPoolExecutor(at_once) as pool:
        actors = list(pool.map(lambda rater: one(address, rater), raters))
    with migrated_services(held) as services:
        return [_record(services.database, actor) for actor in actors]


def _record(database: Database, actor: Actor) -> dict[str, Any]:
    with database.read() as session:
        run = run_called(session, actor.run_id)
        if run is None:
            raise InputError(f"a run did not start: {', '.join(actor.refused) or 'no answer'}")
        judged = judge_run(session, run)
    return {
        "run": actor.run_id,
        "verdict": judged.verdict,
        "points": judged.points,
        "signals": asdict(judged.signals),
        "answers": actor.ratings,
        "warned": dict(Counter(actor.warned)),
        "ended": actor.ended,
        "refused": dict(Counter(actor.refused)),
    }


def write(path: Path, study: str, name: str, runs: list[dict[str, Any]]) -> None:
    """Write the records of all runs as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {"study": study, "as": name, "runs": runs}
    path.write_text(json.dumps(content, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def summary(runs: list[dict[str, Any]]) -> str:
    """How many runs got each verdict, how many answers were refused, how many people were warned."""
    counts = Counter(run["verdict"] for run in runs)
    said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    refused = sum(sum(run["refused"].values()) for run in runs)
    warned = sum(bool(run["warned"]) for run in runs)
    ended = sum(run["ended"] for run in runs)
    said += f"; {refused} answers refused" if refused else ""
    return said + (f"; {warned} warned, {ended} of them ended" if warned else "")
