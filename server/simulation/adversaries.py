"""`server simulate --as`: a manner's runs through the real API, each with the verdict on it."""

import json
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from experiments.errors import InputError, did_you_mean
from server.app import create_app
from server.cli_common import migrated_services
from server.context import Services
from server.evidence.service import judge_run
from server.evidence.verdict import VERDICTS
from server.repository import run_called
from server.settings import Settings
from server.simulation.acting import Actor
from server.simulation.http import JsonClient, Refused, running_server
from server.simulation.manners import MANNERS, Manner
from server.simulation.person import Rater


def manner_called(name: str) -> Manner:
    """The manner of this name; InputError where there is none."""
    if name not in MANNERS:
        raise InputError(f"--as: no manner '{name}'{did_you_mean(name, MANNERS)}")
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
        except Refused as error:
            actor.refused.append(error.code)
        finally:
            client.close()
        return actor

    app = create_app(held, rehearses=True)
    with running_server(app) as address, ThreadPoolExecutor(at_once) as pool:
        actors = list(pool.map(lambda rater: one(address, rater), raters))
    with migrated_services(held) as services:
        return [_record(services, actor) for actor in actors]


def _record(services: Services, actor: Actor) -> dict[str, Any]:
    with services.database.read() as session:
        run = run_called(session, actor.run_id)
        if run is None:
            raise InputError(f"a run was not begun: {', '.join(actor.refused) or 'no answer'}")
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
