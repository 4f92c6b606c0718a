"""The tallies of many runs together: what Results, monitor and participants read instead of ratings."""

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import ColumnElement
from sqlalchemy.orm import Session

from server.tallies import repository
from server.tallies.repository import CellClip
from server.tallies.tally import ONSET_BINS, UNIT, NumberedClip, numbers, packed_codes, unpacked


@dataclass
class PooledTally:
    """The counts of some runs on one scale.

    Attributes
    ----------
    means : dict of str to dict of tuple of str to float
        Run -> levels in the order of the factors -> mean answer.
    answers : mapping
        (clip, second clip, answer) -> how often; clips by their id, second None where there is one.
    times : mapping
        Bin of 250 ms -> answers.
    onsets : list of int
        Answers by bins of 10 ms.
    plays : mapping
        (verdict, method, rule) -> plays, those of excluded runs included.
    """

    means: dict[str, dict[tuple[str, ...], float]] = field(default_factory=dict)
    answers: Counter[tuple[int, int | None, float]] = field(default_factory=Counter)
    times: Counter[int] = field(default_factory=Counter)
    onsets: list[int] = field(default_factory=lambda: [0] * ONSET_BINS)
    plays: Counter[tuple[str, str, str]] = field(default_factory=Counter)


def pooled(session: Session, runs: ColumnElement[bool], scale: str, factors: Sequence[str]) -> PooledTally:
    """The counts of the runs that fit, answers of excluded ones left out."""
    made = PooledTally()
    packed: dict[int, list[str]] = defaultdict(list)
    versions = _Versions(session, factors)
    for run, version, excluded, counts, answers in repository.counts_of(session, runs):
        counted = json.loads(counts)
        _add_plays(made, counted)
        if excluded:
            continue
        _add_times(made, counted)
        text = json.loads(answers).get(scale)
        if text is not None:
            packed[version].append(text)
            sums = counted["cells"].get(scale, ())
            made.means[str(run)] = means_by_cell(sums, versions.levels(version))
    for version, texts in packed.items():
        _add_answers(made, texts, versions.clips(version))
    return made


def means_by_cell(sums: Sequence[int], levels: Sequence[tuple[str, ...]]) -> dict[tuple[str, ...], float]:
    """Levels -> mean answer, of cells that have one; `sums` as `Tally.cells` has them."""
    cells = zip(levels, sums[::2], sums[1::2], strict=False)
    return {key: total / (UNIT * number) for key, number, total in cells if number}


def _add_plays(made: PooledTally, counted: Any) -> None:
    for key, number in counted["plays"].items():
        verdict, method, rule = key.split(" ")
        made.plays[verdict, method, rule] += number


def _add_times(made: PooledTally, counted: Any) -> None:
    for start, number in counted["times"].items():
        made.times[int(start)] += number
    if counted["onsets"]:
        made.onsets = [one + more for one, more in zip(made.onsets, counted["onsets"], strict=True)]


def _add_answers(made: PooledTally, texts: Iterable[str], clips: Sequence[CellClip]) -> None:
    for code, times in Counter(packed_codes(texts)).items():
        first, second, value = unpacked(code)
        made.answers[clips[first].id, None if second is None else clips[second].id, value] += times


class _Versions:
    """The clips of study versions as tallies number them."""

    def __init__(self, session: Session, factors: Sequence[str]) -> None:
        self._session, self._factors = session, factors
        self._clips: dict[int, list[CellClip]] = {}
        self._levels: dict[int, list[tuple[str, ...]]] = {}

    def clips(self, version: int) -> list[CellClip]:
        if version not in self._clips:
            self._clips[version] = repository.clips_of(self._session, version)
        return self._clips[version]

    def levels(self, version: int) -> list[tuple[str, ...]]:
        """The levels of each cell, by its number."""
        if version not in self._levels:
            clips = self.clips(version)
            places: dict[int, NumberedClip] = numbers((clip.id, clip.cell) for clip in clips)
            by_cell: dict[int, tuple[str, ...]] = {}
            for clip in clips:
                levels = tuple(clip.levels[name] for name in self._factors)
                by_cell.setdefault(places[clip.id].cell, levels)
            self._levels[version] = [by_cell[number] for number in sorted(by_cell)]
        return self._levels[version]
