"""CPU of the server for a rating with evidence, over one without, in the same run of the same server.

    python -m bench.evidence_cost [rounds, default 10]

A real server on SQLite with clips as large as those of Experiment 3; in each round one simulated person
rates with ticket, digest and presses and has tickets with her views, and one brings nothing. Prints CPU per
rating of both, alone and with the two writes of its view, and the median of the rounds' ratios.
"""

import statistics
import sys
import tempfile
import time
import uuid
from pathlib import Path
from typing import Any

import psutil

from bench.harness import with_children
from server.cli_common import migrated_services
from server.core.values import now
from server.participation.clip_hashes import clip_digest, clip_hash
from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.browser.server_process import ServerProcess
from tests.helpers.studies import SHORT, add_study

STUDY = SHORT.replace("per_cell = 2", "per_cell = 20")
CLIP_BYTES = 250_000
DRAWN = [[frame, 33.3 * frame] for frame in range(90)]
CPU_CLOCK = 2
"""Of the clocks of another process that Linux numbers by its id, the one of its CPU time."""
INTERACTION = {"presses": 2, "trusted": 2, "press_ms": 90.0, "moves": 12}


def main(rounds: int) -> None:
    """Print one table."""
    with tempfile.TemporaryDirectory() as folder:
        process = ServerProcess(Path(folder) / "data", evidence="record", run_starts_per_minute="100000")
        with migrated_services(process.settings) as services:
            study = add_study(services, Path(folder) / "clips", STUDY, frames=1, clip_bytes=CLIP_BYTES)
            token = study.link(synthetic=True)
        process.start()
        try:
            used: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
            clips: dict[str, bytes] = {}
            for number in range(rounds + 1):
                for evidence in (True, False) if number % 2 else (False, True):
                    spent = rated(process, token, number, clips, evidence=evidence)
                    if number:  # the first round fills caches
                        used[evidence].append(spent)
        finally:
            process.stop()
    for number, what in enumerate(("a rating", "a rating and its view")):
        spent = {evidence: [pair[number] for pair in pairs] for evidence, pairs in used.items()}
        for evidence, name in ((False, "without evidence"), (True, "with evidence")):
            title = f"CPU of the server {what}, {name}"
            sys.stdout.write(f"{title:<58} {statistics.median(spent[evidence]) * 1000:>13.3f} ms\n")
        # Pairs of one round: on a busy machine both are slowed alike.
        ratio = statistics.median(a / b for a, b in zip(spent[True], spent[False], strict=True))
        sys.stdout.write(f"{'with evidence over without':<58} {ratio:>16.3f} {'< 1.15':>12}\n")


def rated(
    process: ServerProcess, token: str, number: int, clips: dict[str, bytes], *, evidence: bool
) -> tuple[float, float]:
    """CPU seconds of the server per rating, alone and with its view, of one person who rates everything."""
    client = JsonClient(process.address)
    person = Person(client, Rater(2 * number + evidence, 1, {}))
    person.brings_evidence = evidence
    person.begin(token)
    client.put("/api/run/consent", {"agreed": True})
    state = client.get("/api/run")
    assert (state["tickets"] is not None) == evidence
    bodies = [person.rating(trial, state["trial"]) for trial in state["trials"]]
    if evidence:
        for trial, body in zip(state["trials"], bodies, strict=True):
            body["evidence"] = brought(client, trial, state["tickets"], clips)
    # Else answers would be refused, and what is measured would not be what happens to people.
    time.sleep(sum(trial["frames"] / trial["fps"] for trial in state["trials"] if trial["frames"]))
    before = cpu(process)
    for trial, body in zip(state["trials"], bodies, strict=True):
        for view in views_of(trial, body.get("evidence")):
            client.post("/api/run/views", {"views": [view]})
    between = cpu(process)
    for body in bodies:
        client.put(f"/api/run/ratings/{uuid.uuid4()}", body)
    after = cpu(process)
    client.close()
    return (after - between) / len(bodies), (after - before) / len(bodies)


def views_of(trial: dict[str, Any], evidence: dict[str, Any] | None) -> list[dict[str, Any]]:
    """A view as the page sends it when it begins and when it has ended."""
    if not trial["clip_sha256"]:
        return []
    began: dict[str, Any] = {
        "id": str(uuid.uuid4()),
        "trial_index": trial["trial_index"],
        "number": 1,
        "play": 1,
        "started_at_client": now().isoformat(),
        "evidence": evidence and {name: evidence[name] for name in ("batch", "ticket")},
    }
    clips = [
        {"role": clip["role"], "clip_sha256": clip["clip_sha256"], "drawn": DRAWN} for clip in trial["clips"]
    ]
    return [began, began | {"ended_at_client": now().isoformat(), "outcome": "shown", "clips": clips}]


def brought(
    client: JsonClient, trial: dict[str, object], tickets: dict[str, object], clips: dict[str, bytes]
) -> dict[str, object]:
    """What the page sends with a rating."""
    ticket = tickets["by_trial"][trial["trial_index"]][0]  # type: ignore[index]
    sha256 = str(trial["clip_sha256"]) if trial["clip_sha256"] else ""
    if sha256 and sha256 not in clips:
        clips[sha256] = client.fetch(f"/clips/{sha256}.mp4")
    digest = clip_digest(ticket, clip_hash(clips[sha256])) if sha256 else None
    return {"batch": tickets["batch"], "ticket": ticket, "digest": digest, "interaction": INTERACTION}


def cpu(process: ServerProcess) -> float:
    """CPU seconds of the server so far, including its child processes."""
    assert process.process is not None
    return sum(cpu_of(one) for one in with_children(process.process.pid))


def cpu_of(process: psutil.Process) -> float:
    """CPU seconds of one process: to the nanosecond in Linux, elsewhere to what its times are counted in."""
    if sys.platform != "linux":
        return sum(process.cpu_times()[:2])
    return time.clock_gettime(~process.pid << 3 | CPU_CLOCK)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
