"""Results of the bench on disk, each as it ends, so that a run that was stopped goes on where it was."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
MEASURED = (
    "frontend/src/participant/playback",
    "server/participation/verdict.py",
    "experiments/rules/playback.py",
)
"""What draws clips and judges plays: with another one, plays of before are of something else."""


@cache
def measured_sha256() -> str:
    """Of all source files that draw and judge."""
    sources = [ROOT / source for source in MEASURED]
    files = sorted(
        file for source in sources for file in (source.rglob("*.ts") if source.is_dir() else [source])
    )
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()[:16]


@dataclass(frozen=True)
class Result:
    """One thing measured, once.

    Attributes
    ----------
    key : tuple of str
        What was measured.
    count : int
        Of how many plays.
    cells : tuple of str
        A line of the table, or one sentence.
    details : object
        All that was measured, as JSON has it.
    """

    key: tuple[str, ...]
    count: int
    cells: tuple[str, ...]
    at: str
    details: Any = None


class Results:
    """A file of results, one JSON object a line.

    Results of one key add up, and what has as many plays as asked for, or more, is not measured again. Those
    of other sources (`measured_sha256`) stay in the file and count for nothing; so do, with `again`, those
    of before.
    """

    def __init__(self, path: Path, again: bool = False) -> None:
        self.path = path
        self._known: dict[tuple[str, ...], list[Result]] = {}
        if path.is_file():
            for line in path.read_text(encoding="utf-8").splitlines():
                self._take(json.loads(line))
        self._anew = set(self._known) if again else set()

    def _take(self, stored: dict[str, Any]) -> None:
        key = tuple(stored["key"])
        if stored.get("measured") != measured_sha256():
            return
        if stored["anew"]:
            self._known.pop(key, None)
        result = Result(key, stored["count"], tuple(stored["cells"]), stored["at"], stored["details"])
        self._known.setdefault(key, []).append(result)

    def count(self, key: tuple[str, ...]) -> int:
        """How many plays there are of it."""
        return 0 if key in self._anew else sum(result.count for result in self._known.get(key, []))

    def has(self, key: tuple[str, ...], count: int) -> bool:
        """True where it was measured with as many plays already."""
        return self.count(key) >= count

    def add(self, key: tuple[str, ...], count: int, cells: Sequence[str], details: Any) -> None:
        """Write a result down at once."""
        stored = {
            "key": key,
            "count": count,
            "cells": list(cells),
            "at": datetime.now(UTC).isoformat(timespec="seconds"),
            "measured": measured_sha256(),
            "anew": key in self._anew,
            "details": details,
        }
        self._anew.discard(key)
        self._take(stored)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(stored) + "\n")

    def pieces(self, key: tuple[str, ...]) -> list[Result]:
        """All results of a key, the first one first."""
        return list(self._known.get(key, []))

    def keys(self, kind: str) -> list[tuple[str, ...]]:
        """All keys of a kind, which is their first word."""
        return [key for key in self._known if key[0] == kind]

    def of(self, kind: str) -> list[Result]:
        """The latest result of each key of a kind."""
        return [self._known[key][-1] for key in self.keys(kind)]
