"""What a load test measures, and the lines of its table."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

import psutil
from sqlalchemy import select, text

from server.models import Rating
from tools.load_client import Tally, percentile
from tools.load_server import LoadServer


@dataclass(frozen=True)
class Row:
    """One line of the table; `met` is None where there is no target."""

    scenario: str
    what: str
    measured: str
    target: str = ""
    met: bool | None = None


class Clocks:
    """Processor time from its making on: server, database, the raters here, and all else on this machine."""

    def __init__(self, server: LoadServer) -> None:
        self.server = server
        self.used: dict[str, float] = {}
        self.cores_s = 0.0
        self.memory_mb: list[float] = []
        self.began, self._then = time.monotonic(), self._now()

    def _now(self) -> dict[str, float]:
        idle = psutil.cpu_times()
        return {
            "server": self.server.cpu_s(),
            "database": self.server.database.cpu_s(),
            "raters": time.process_time(),
            "machine": sum(idle) - idle.idle - getattr(idle, "iowait", 0.0) - getattr(idle, "guest", 0.0),
        }

    def stop(self) -> None:
        """Read them for the last time, and the memory of each process of the server."""
        self.memory_mb = [process.memory_info().rss / 1e6 for process in self.server.processes()]
        self.used = {name: value - self._then[name] for name, value in self._now().items()}
        self.used["others"] = max(0.0, 2 * self.used["machine"] - sum(self.used.values()))
        self.cores_s = (time.monotonic() - self.began) * (os.cpu_count() or 1)

    def rows(self, ratings: int) -> list[Row]:
        """Processor time per rating, and the share of all cores each has used."""
        each = [self.used[process] / max(1, ratings) for process in ("server", "database", "raters")]
        shares = [self.used[process] / self.cores_s for process in ("server", "database", "raters", "others")]
        said = " / ".join(f"{1000 * cost:.2f}" for cost in each)
        memory = ", ".join(f"{one:.0f}" for one in self.memory_mb)
        split = " / ".join(f"{100 * share:.0f}" for share in shares)
        return [
            Row("", "CPU per rating with its clip: server / database / raters (ms)", said),
            Row("", "share of the cores: server / database / raters / others (%)", split),
            Row("", "memory of each process of the server (MB)", memory),
        ]


def stored(server: LoadServer, tally: Tally) -> tuple[int, int]:
    """Acknowledged ratings that are not in the database as sent, and ratings stored twice."""
    with server.services.database.read() as session:
        answers = session.execute(select(Rating.rating_id, Rating.payload))
        responses = {
            rating_id: payload.get("response", payload.get("check")) for rating_id, payload in answers
        }
        plays = session.execute(
            text(
                "SELECT count(*) FROM (SELECT 1 FROM trial_ratings "
                "GROUP BY study_run_id, trial_index, play HAVING count(*) > 1) AS twice"
            )
        ).scalar_one()
    lost = sum(responses.get(rating_id, "none") != value for rating_id, value in tally.acknowledged.items())
    return lost, int(plays)


def quantiles(values: list[float], *shares: float) -> str:
    """Quantiles in whole ms, as text."""
    return " / ".join(f"{percentile(values, share):.0f}" for share in shares)


def saved(server: LoadServer, tally: Tally) -> Row:
    """Whether everything acknowledged is there, once."""
    lost, twice = stored(server, tally)
    counts = (lost, twice, tally.given_up)
    said = "; ".join(map(str, counts))
    return Row("", "lost; stored twice; given up", said, "0; 0; 0", counts == (0, 0, 0))
