"""Results of the bench on disk, each as it ends, so that a run that was stopped goes on where it was."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any


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
    """

    key: tuple[str, ...]
    count: int
    cells: tuple[str, ...]
    at: str


class Results:
    """A file of results, one JSON object a line.

    A result of as many plays as asked for, or more, is not measured again; with `again` everything is.
    """

    def __init__(self, path: Path, again: bool = False) -> None:
        self.path = path
        self._known: dict[tuple[str, ...], Result] = {}
        if path.is_file() and not again:
            for line in path.read_text(encoding="utf-8").splitlines():
                stored = json.loads(line)
                result = Result(tuple(stored["key"]), stored["count"], tuple(stored["cells"]), stored["at"])
                self._known[result.key] = result

    def has(self, key: tuple[str, ...], count: int) -> bool:
        """True where it was measured with as many plays already."""
        return key in self._known and self._known[key].count >= count

    def add(self, key: tuple[str, ...], count: int, cells: Sequence[str], details: Any) -> None:
        """Write a result down at once."""
        result = Result(key, count, tuple(cells), datetime.now(UTC).isoformat(timespec="seconds"))
        self._known[key] = result
        self.path.parent.mkdir(parents=True, exist_ok=True)
        stored = {"key": key, "count": count, "cells": result.cells, "at": result.at, "details": details}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(stored) + "\n")

    def of(self, kind: str) -> list[Result]:
        """All results of a kind, the first word of their keys."""
        return [result for result in self._known.values() if result.key[0] == kind]
