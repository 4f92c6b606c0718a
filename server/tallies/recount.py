"""Tallies by a full count of the ratings: to check what was kept with each rating, and to mend it."""

from collections.abc import Iterator, Sequence
from itertools import groupby

from sqlalchemy.orm import Session

from server.db import Database
from server.tallies import repository
from server.tallies.repository import ShownClip
from server.tallies.tally import Counted, Play, Tally
from server.trials.kinds import served
from server.versions import Versions


class Recount:
    """A full count; `runs` is how many runs it has looked at."""

    def __init__(self, versions: Versions) -> None:
        self._versions = versions
        self.runs = 0

    def differing(self, session: Session) -> Iterator[int]:
        """The numbers of the runs whose stored tally is not that of their ratings."""
        after = 0
        while runs := repository.runs_after(session, after):
            counted, stored = self.counted(session, runs), repository.stored_tallies(session, runs)
            for run in runs:
                if not counted.get(run, Tally()).same(stored.get(run, Tally())):
                    yield run
            self.runs, after = self.runs + len(runs), runs[-1]

    def counted(self, session: Session, runs: Sequence[int]) -> dict[int, Tally]:
        """Run -> what its ratings and their evidence come to; without runs that have none."""
        tallies: dict[int, Tally] = {}
        rows = repository.shown_clips(session, runs)
        for (run, _, _), shown in groupby(rows, key=lambda row: row[:3]):
            tallies.setdefault(run, Tally()).add(self._play(session, list(shown)))
        for run, clip_time in repository.clip_times(session, runs).items():
            tallies.setdefault(run, Tally()).clip_time = clip_time
        return tallies

    def _play(self, session: Session, shown: Sequence[ShownClip]) -> Play:
        """A play from its rows, one for each clip of its trial."""
        row, is_main = shown[0], shown[0].part == "main"
        numbered = self._versions.get(session, row.version).numbered
        answers: tuple[Counted, ...] = ()
        if is_main:
            places = {one.role: numbered[one.clip] for one in shown if one.role and one.clip is not None}
            answers = tuple(served(row.kind).counted(places, row.payload))
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
    """Mend every tally that differs, a run a transaction; return how many were mended, of how many."""
    compared = Recount(versions)
    with database.snapshot() as session:
        wrong = list(compared.differing(session))
    for run in wrong:
        with database.write() as session:
            repository.lock_run(session, run)
            repository.replace_tally(session, run, compared.counted(session, [run]).get(run))
    return len(wrong), compared.runs
