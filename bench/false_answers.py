"""Answers and views with false evidence at full speed against a real server, and honest raters at the same
time.

python -m bench.false_answers                    twenty seconds, six raters
python -m bench.false_answers --seconds 60 --json counts.json

The attacker has its own visits and an honest rater's tickets: it sends none, changed ones, those of
another visit, trial or time, one used before, and the digest of another clip. Printed is what each kind was
answered with, what became of the honest answers, and how many lines the server's log grew by. Ends with
code 1 where a false answer was taken or stored, an honest one refused, or a refusal noted more than once for
a visit and reason.
"""

import argparse
import json
import random
import sys
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from datetime import timedelta
from itertools import zip_longest
from pathlib import Path
from typing import Any

from server.core.values import now
from server.participation.clip_hashes import clip_digest, clip_hash
from server.participation.intake import evidence_key, issue, ticket
from server.rehearsals.http import JsonClient, RefusedRequest
from server.rehearsals.person import Person, Rater
from tests.browser.server_process import ServerProcess
from tests.helpers.studies import SHORT

FRAMES, FPS, READ_S = 3, 30, 0.2
"""Clips of a tenth of a second, so that honest visits are many; how long a rater takes to answer."""
VISITS_OF_ATTACKER = 4
INTERACTION = {"presses": 2, "trusted": 2, "press_ms": 90.0, "moves": 5}
Body = dict[str, Any]


@dataclass(frozen=True)
class Counts:
    """What came of a session.

    Attributes
    ----------
    answers : dict of str to dict of str to int
        By kind of falsehood, how often each answer came.
    """

    attack_s: float
    false_sent: int
    false_taken: int
    answers: dict[str, dict[str, int]]
    honest_taken: int
    honest_refused: dict[str, int]
    honest_slowest_ms: float
    false_stored: int
    noted: int
    noted_twice: int
    log_lines: int

    def faults(self) -> list[str]:
        """What must not be."""
        said = []
        if self.false_taken or self.false_stored:
            said.append(f"{self.false_taken} false answers taken, {self.false_stored} stored")
        if self.honest_refused or not self.honest_taken:
            said.append(f"honest answers: {self.honest_taken} taken, refused {self.honest_refused}")
        if self.noted_twice:
            said.append(f"{self.noted_twice} refusals noted more than once")
        if self.log_lines > self.noted:
            said.append(f"the log grew by {self.log_lines} lines for {self.noted} refusals noted")
        return said


class Visit(Person):
    """A visit with its tickets, of an honest rater or of the attacker."""

    def __init__(self, address: str, link: str, seed: int) -> None:
        self.http = JsonClient(address)
        super().__init__(self.http, Rater(seed, 1, {}))
        self.brings_evidence = True
        self.begin(link)
        self.client.put("/api/run/consent", {"agreed": True})
        self.state = self.client.get("/api/run")
        self.clips: dict[str, bytes] = {}

    def evidence(self, trial: Body) -> Body:
        """What the page sends with a rating."""
        own = self.state["tickets"]
        code = own["by_trial"][trial["trial_index"]][0]
        digest = None
        if trial["clip_sha256"]:
            if trial["clip_sha256"] not in self.clips:
                self.clips[trial["clip_sha256"]] = self.http.fetch(f"/clips/{trial['clip_sha256']}.mp4")
            digest = clip_digest(code, clip_hash(self.clips[trial["clip_sha256"]]))
        return {"batch": own["batch"], "ticket": code, "digest": digest, "interaction": INTERACTION}

    def view(self, trial: Body, evidence: Body | None, *, ended: bool) -> Body:
        """A view of a trial, as it begins or as it has ended."""
        given = evidence and {name: evidence[name] for name in ("batch", "ticket")}
        view = {"id": str(uuid.uuid4()), "trial_index": trial["trial_index"], "number": 1, "play": 1}
        view |= {"started_at_client": now().isoformat(), "evidence": given}
        return view | ({"ended_at_client": now().isoformat(), "outcome": "shown"} if ended else {})


Request = tuple[Visit, str, str, str, Body]
"""Whose it is, what is false in it, method, path and body."""


@dataclass(frozen=True)
class Target:
    """What the attacker knows: address, link, a victim's tickets, and the secret key, to make old tickets."""

    address: str
    link: str
    secret: bytes
    victim: Body


Falsehood = Callable[[Body, Body, "Attacker"], Body | None]


class Attacker:
    """Visits that send one true answer each, and then nothing true."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self.visits = [Visit(target.address, target.link, 10_000 + n) for n in range(VISITS_OF_ATTACKER)]
        time.sleep(FRAMES / FPS)
        self.used = [self._answered(visit) for visit in self.visits]

    def _answered(self, visit: Visit) -> Body:
        trial = _with_clips(visit)[0]
        body = visit.rating(trial, visit.state["trial"]) | {"evidence": visit.evidence(trial)}
        visit.client.put(f"/api/run/ratings/{uuid.uuid4()}", body)
        other = json.loads(json.dumps(body))
        for scale in other["answer"]["answers"].values():
            scale["response"] = 1 if scale["response"] != 1 else 2
        return dict(other)

    def expired(self, visit: Visit, trial: Body) -> Body:
        """Tickets that were good two months ago."""
        key = evidence_key(self.target.secret)
        batch = issue(key, visit.state["run_id"], now() - timedelta(days=61))
        return {"batch": batch.text, "ticket": ticket(key, batch, trial["trial_index"], 1)}

    def falsehoods(self, visit: Visit, trial: Body) -> dict[str, Body | None]:
        """Evidence of each false kind for a trial."""
        good, last = visit.evidence(trial), visit.state["trials"][-1]
        other = last if last["trial_index"] != trial["trial_index"] else visit.state["trials"][0]
        theirs = self.target.victim
        stolen = theirs["by_trial"][trial["trial_index"]][0]
        return {
            "no ticket": None,
            "batch changed": good
            | {"batch": f"{good['batch'][:-1]}{'A' if good['batch'][-1] != 'A' else 'B'}"},
            "ticket changed": good | {"ticket": "A" * 22},
            "of another visit": good | {"batch": theirs["batch"], "ticket": stolen},
            "of another trial": good | {"ticket": visit.evidence(other)["ticket"]},
            "expired": good | self.expired(visit, trial),
            "digest of another clip": good | {"digest": "0" * 64},
            "no digest": good | {"digest": None},
            "more trusted than presses": good | {"interaction": INTERACTION | {"trusted": 9}},
        }


def attack(target: Target, seconds: float) -> tuple[dict[str, dict[str, int]], float]:
    """Send what is false for so long; how often each kind was answered with what, and how long it took."""
    attacker = Attacker(target)
    answers: dict[str, Counter[str]] = {}
    requests: list[Request] = [
        (visit, kind, *request)
        for visit in attacker.visits
        for trial in _with_clips(visit)[1:]  # the first is answered
        for kind, evidence in attacker.falsehoods(visit, trial).items()
        for request in _requests(visit, trial, kind, evidence)
    ]
    again = ("used before, another answer", "PUT", "/api/run/ratings")
    requests += [(visit, *again, body) for visit, body in zip(attacker.visits, attacker.used, strict=True)]
    random.Random(1).shuffle(requests)
    requests = _in_turn(requests)
    kinds = len({kind for _, kind, *_ in requests})
    begun, number = time.monotonic(), 0
    # Every kind at least once, however slow the machine is.
    while number < kinds or time.monotonic() < begun + seconds:
        visit, kind, method, path, body = requests[number % len(requests)]
        number += 1
        if method == "PUT":
            path = f"{path}/{uuid.uuid4()}"
        try:
            said = f"{visit.http.call(method, path, body)[0]} taken"
        except RefusedRequest as refusal:
            said = f"{refusal.status} {refusal.code}"
        answers.setdefault(kind, Counter())[said] += 1
    lasted = time.monotonic() - begun
    for visit in attacker.visits:
        visit.http.close()
    return {kind: dict(counts) for kind, counts in answers.items()}, lasted


def _in_turn(requests: list[Request]) -> list[Request]:
    """One of each kind after another, so that every kind comes however few there is time for."""
    by_kind: dict[str, list[Request]] = {}
    for request in requests:
        by_kind.setdefault(request[1], []).append(request)
    turns = zip_longest(*by_kind.values())
    return [request for turn in turns for request in turn if request is not None]


def _with_clips(visit: Visit) -> list[Body]:
    return [trial for trial in visit.state["trials"] if trial["clip_sha256"]]


def _requests(visit: Visit, trial: Body, kind: str, evidence: Body | None) -> list[tuple[str, str, Body]]:
    rating = visit.rating(trial, visit.state["trial"]) | {"evidence": evidence}
    requests: list[tuple[str, str, Body]] = [("PUT", "/api/run/ratings", rating)]
    if "digest" not in kind and "presses" not in kind:  # views bring tickets alone
        view = visit.view(trial, evidence, ended=True)
        requests.append(("POST", "/api/run/views", {"views": [view]}))
    return requests


def rate_honestly(address: str, link: str, number: int, end: float) -> tuple[int, Counter[str], float]:
    """Visit after visit until then: answers taken, refusals by code, and the slowest answer in ms."""
    taken, refused, slowest, seed = 0, Counter[str](), 0.0, number * 1000
    while time.monotonic() < end:
        seed += 1
        visit = Visit(address, link, seed)
        for trial in visit.state["trials"]:
            evidence = visit.evidence(trial)
            view = visit.view(trial, evidence, ended=False)
            body = visit.rating(trial, visit.state["trial"])
            calls: list[tuple[str, str, Body]] = []
            if trial["clip_sha256"]:
                calls.append(("POST", "/api/run/views", {"views": [view]}))
                shown = view | {"ended_at_client": now().isoformat(), "outcome": "shown"}
                calls.append(("POST", "/api/run/views", {"views": [shown]}))
            calls.append(("PUT", f"/api/run/ratings/{uuid.uuid4()}", body | {"evidence": evidence}))
            time.sleep(FRAMES / FPS + READ_S)
            for call in calls:
                begun = time.monotonic()
                try:
                    visit.http.call(*call)
                    taken += 1
                except RefusedRequest as refusal:
                    refused[f"{refusal.status} {refusal.code}"] += 1
                slowest = max(slowest, 1000 * (time.monotonic() - begun))
        visit.http.close()
    return taken, refused, slowest


def session(folder: Path, seconds: float, raters: int) -> Counts:
    """A server as a process, an attacker as another, and raters; what came of it."""
    server = ServerProcess(folder / "data", evidence="refuse", run_starts_per_minute="100000")
    link = server.add_study(folder / "clips", SHORT, frames=FRAMES).link_token
    server.start()
    try:
        victim = Visit(server.address, link, 1)
        victim.http.close()
        target = Target(server.address, link, server.settings.key, victim.state["tickets"])
        lines = len(server.log.read_text().splitlines())
        end = time.monotonic() + seconds
        with ProcessPoolExecutor(1) as attackers, ThreadPoolExecutor(raters) as pool:
            attacking = attackers.submit(attack, target, seconds)
            rating = [
                pool.submit(rate_honestly, server.address, link, number, end)
                for number in range(1, raters + 1)
            ]
            (answers, attack_s), honest = attacking.result(), [one.result() for one in rating]
        lines = len(server.log.read_text().splitlines()) - lines
        return _counts(server, attack_s, answers, honest, lines)
    finally:
        server.stop()


def _counts(
    server: ServerProcess,
    seconds: float,
    answers: dict[str, dict[str, int]],
    honest: list[tuple[int, Counter[str], float]],
    lines: int,
) -> Counts:
    of_attacker = "SELECT study_run_id FROM run_events WHERE type LIKE '%refused'"
    stored = "SELECT (SELECT count(*) FROM trial_ratings WHERE study_run_id IN ({0})) + "
    stored += "(SELECT count(*) FROM views WHERE study_run_id IN ({0})) AS number"
    noted = server.rows("SELECT study_run_id, type, data FROM run_events WHERE type LIKE '%refused'")
    noted += server.rows("SELECT study_run_id, type, data FROM run_events WHERE type LIKE '%expired'")
    every = Counter(str(sorted(row.items())) for row in noted)
    said = Counter[str]()
    for counts in answers.values():
        said.update(counts)
    return Counts(
        attack_s=round(seconds, 1),
        false_sent=said.total(),
        false_taken=sum(number for answer, number in said.items() if answer.startswith("2")),
        answers=answers,
        honest_taken=sum(taken for taken, _, _ in honest),
        honest_refused=dict(sum((refused for _, refused, _ in honest), Counter[str]())),
        honest_slowest_ms=round(max(slowest for _, _, slowest in honest), 1),
        false_stored=server.rows(stored.format(of_attacker))[0]["number"] - VISITS_OF_ATTACKER,
        noted=len(noted),
        noted_twice=sum(number > 1 for number in every.values()),
        log_lines=lines,
    )


def table(counts: Counts) -> str:
    """As Markdown, and a line of totals."""
    lines = ["| false by | answered with |", "|---|---|"]
    for kind, answers in counts.answers.items():
        said = ", ".join(f"{number} x {answer}" for answer, number in sorted(answers.items()))
        lines.append(f"| {kind} | {said} |")
    a_minute = 60 * counts.false_sent / counts.attack_s
    lines.append(
        f"\n{counts.false_sent} false answers and views in {counts.attack_s:.0f} s "
        f"({a_minute:.0f} a minute), {counts.false_taken} taken; {counts.honest_taken} honest ones taken, "
        f"{sum(counts.honest_refused.values())} refused, the slowest in {counts.honest_slowest_ms:.0f} ms; "
        f"{counts.noted} events, {counts.log_lines} lines of log."
    )
    return "\n".join(lines)


def main() -> int:
    """Print what came of it; 1 where something must not be so."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    asked.add_argument("--seconds", type=float, default=20, help="how long (20)")
    asked.add_argument("--raters", type=int, default=6, help="honest raters at the same time (6)")
    asked.add_argument("--json", type=Path, help="keep the counts here")
    options = asked.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        counts = session(Path(folder), options.seconds, options.raters)
    if options.json:
        options.json.write_text(json.dumps(asdict(counts), indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(table(counts) + "\n")
    faults = counts.faults()
    sys.stderr.writelines(f"error: {fault}\n" for fault in faults)
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
