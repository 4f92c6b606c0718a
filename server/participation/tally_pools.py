"""The tallies of many runs together, and tallies by a full count of the ratings."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from pydantic_core import from_json
from sqlalchemy import ColumnElement
from sqlalchemy.orm import Session

from server.core.db import Database
from server.participation import tally_repository
from server.participation.kinds import served_kind
from server.participation.tallies import (
    ONSET_BINS,
    UNIT,
    NumberedClip,
    Play,
    Tally,
    TallyEntry,
    numbers,
    packed_bytes,
    packed_codes,
    unpack_answer,
)
from server.participation.tally_repository import CellClip, ShownClip
from server.participation.versions import Versions

# The tallies of many runs together: what Results, monitor and participants read instead of ratings.


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


def pooled_tally(
    session: Session, runs: ColumnElement[bool], scale: str, factors: Sequence[str]
) -> PooledTally:
    """The counts of the runs that fit, answers of excluded ones left out."""
    made, kept = PooledTally(), _StoredCounts()
    packed: dict[int, bytearray] = defaultdict(bytearray)
    versions = _Versions(session, factors)
    for run, version, excluded, counts, answers in tally_repository.counts_of(session, runs):
        counted = from_json(counts)
        kept.plays.append(counted["plays"])
        if excluded:
            continue
        kept.take_times(counted)
        text = from_json(answers, cache_strings=False).get(scale)
        if text is not None:
            packed[version] += packed_bytes(text)
            sums = counted["cells"].get(scale, ())
            made.means[str(run)] = means_by_cell(sums, versions.levels(version))
    kept.add_to(made)
    for version, codes in packed.items():
        _add_answers(made, codes, versions.clips(version))
    return made


@dataclass
class _StoredCounts:
    """The counts of many runs as they are stored: summed at once, which thousands of runs are quicker by."""

    plays: list[dict[str, int]] = field(default_factory=list)
    times: list[dict[str, int]] = field(default_factory=list)
    onsets: list[list[int]] = field(default_factory=list)

    def take_times(self, counted: Any) -> None:
        self.times.append(counted["times"])
        if counted["onsets"]:
            self.onsets.append(counted["onsets"])

    def add_to(self, made: PooledTally) -> None:
        for key, number in _summed_counts(self.plays).items():
            verdict, method, rule = key.split(" ")
            made.plays[verdict, method, rule] = number
        for start, number in _summed_counts(self.times).items():
            made.times[int(start)] = number
        if self.onsets:
            made.onsets = [sum(numbers) for numbers in zip(*self.onsets, strict=True)]


def _summed_counts(counts: Iterable[dict[str, int]]) -> dict[str, int]:
    """Key -> the sum of its counts."""
    made: dict[str, int] = defaultdict(int)
    for one in counts:
        for key, number in one.items():
            made[key] += number
    return made


def means_by_cell(sums: Sequence[int], levels: Sequence[tuple[str, ...]]) -> dict[tuple[str, ...], float]:
    """Levels -> mean answer, of cells that have one; `sums` as `Tally.cells` has them."""
    # A stored tally ends with the last cell that has an answer: the cells after it have no mean.
    cells = zip(levels, sums[::2], sums[1::2], strict=False)
    return {key: total / (UNIT * number) for key, number, total in cells if number}


def _add_answers(made: PooledTally, packed: bytearray, clips: Sequence[CellClip]) -> None:
    for code, times in Counter(packed_codes(packed)).items():
        first, second, value = unpack_answer(code)
        made.answers[clips[first].id, None if second is None else clips[second].id, value] += times


class _Versions:
    """The clips of study versions as tallies number them."""

    def __init__(self, session: Session, factors: Sequence[str]) -> None:
        self._session, self._factors = session, factors
        self._clips: dict[int, list[CellClip]] = {}
        self._levels: dict[int, list[tuple[str, ...]]] = {}

    def clips(self, version: int) -> list[CellClip]:
        if version not in self._clips:
            self._clips[version] = tally_repository.clips_of(self._session, version)
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


# Tallies by a full count of the ratings: to check what was kept with each rating, and to fix it.


class Recount:
    """A full count; `runs` is how many runs it has looked at."""

    def __init__(self, versions: Versions) -> None:
        self._versions = versions
        self.runs = 0

    def differing(self, session: Session) -> Iterator[int]:
        """The numbers of the runs whose stored tally is not that of their ratings."""
        after = 0
        while runs := tally_repository.runs_after(session, after):
            counted, stored = self.counted(session, runs), tally_repository.stored_tallies(session, runs)
            for run in runs:
                if not counted.get(run, Tally()).same(stored.get(run, Tally())):
                    yield run
            self.runs, after = self.runs + len(runs), runs[-1]

    def counted(self, session: Session, runs: Sequence[int]) -> dict[int, Tally]:
        """Run -> what its ratings and their evidence come to; without runs that have none."""
        tallies: dict[int, Tally] = {}
        rows = tally_repository.shown_clips(session, runs)
        for (run, _, _), shown in groupby(rows, key=lambda row: row[:3]):
            tallies.setdefault(run, Tally()).add(self._play(session, list(shown)))
        for run, clip_time in tally_repository.clip_times(session, runs).items():
            tallies.setdefault(run, Tally()).clip_time = clip_time
        return tallies

    def _play(self, session: Session, shown: Sequence[ShownClip]) -> Play:
        """A play from its rows, one for each clip of its trial."""
        row, is_main = shown[0], shown[0].part == "main"
        numbered = self._versions.get(session, row.version).numbered
        answers: tuple[TallyEntry, ...] = ()
        if is_main:
            places = {one.role: numbered[one.clip] for one in shown if one.role and one.clip is not None}
            answers = tuple(served_kind(row.kind).counted(places, row.payload))
        return Play(
            row.trial_index,
            is_main,
            row.verdict,
            row.verdict_rule,
            row.method,
            row.rt,
            row.onset,
            answers,
        )


def repair(database: Database, versions: Versions) -> tuple[int, int]:
    """Fix every tally that differs, one run per transaction; return how many were fixed, of how many."""
    compared = Recount(versions)
    # One snapshot: read at two moments, every rating stored between them would look like a fault.
    with database.snapshot() as session:
        wrong = list(compared.differing(session))
    for run in wrong:
        with database.write() as session:
            tally_repository.lock_run(session, run)
            # Counted again under the lock: ratings may have come since the comparison.
            tally_repository.replace_tally(session, run, compared.counted(session, [run]).get(run))
    return len(wrong), compared.runs
