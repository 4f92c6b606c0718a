"""Tallies by a full count of the ratings: to check what was kept with each rating, and to mend it."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session

from server.db import Database
from server.models import AssignedTrial, Rating, RunTally, StudyRun, TrialClip
from server.tallies.tally import Counted, Play, Tally, tally_of
from server.trials.kinds import served
from server.versions import Versions

RUNS_AT_ONCE = 100
_PLAYS = (
    select(
        Rating.study_run_id,
        Rating.trial_index,
        Rating.play,
        Rating.kind.label("kind"),
        AssignedTrial.kind.label("part"),
        Rating.payload,
        Rating.verdict,
        Rating.verdict_rule,
        Rating.method,
        Rating.rt,
        Rating.key_to_first_frame_ms,
        StudyRun.version_id,
        TrialClip.role,
        TrialClip.version_clip_id,
    )
    .join(
        AssignedTrial,
        (AssignedTrial.study_run_id == Rating.study_run_id)
        & (AssignedTrial.trial_index == Rating.trial_index),
    )
    .join(StudyRun, StudyRun.id == Rating.study_run_id)
    .outerjoin(
        TrialClip,
        (TrialClip.study_run_id == Rating.study_run_id) & (TrialClip.trial_index == Rating.trial_index),
    )
    .order_by(Rating.study_run_id, Rating.trial_index, Rating.play)
)


class Recount:
    """A full count; `runs` is how many runs it has looked at."""

    def __init__(self, versions: Versions) -> None:
        self._versions = versions
        self.runs = 0

    def differing(self, session: Session) -> Iterator[int]:
        """The numbers of the runs whose stored tally is not that of their ratings."""
        after = 0
        while runs := _runs_after(session, after):
            counted, stored = self.counted(session, runs), _stored(session, runs)
            for run in runs:
                if not counted.get(run, Tally()).same(stored.get(run, Tally())):
                    yield run
            self.runs, after = self.runs + len(runs), runs[-1]

    def counted(self, session: Session, runs: Sequence[int]) -> dict[int, Tally]:
        """Run -> what its ratings come to; without runs that have none."""
        tallies: dict[int, Tally] = {}
        rows = session.execute(_of(_PLAYS, Rating.study_run_id, runs)).all()
        for (run, _, _), shown in groupby(rows, key=lambda row: row[:3]):
            tallies.setdefault(run, Tally()).add(self._play(session, list(shown)))
        return tallies

    def _play(self, session: Session, shown: Sequence[Any]) -> Play:
        """A play from its rows, one for each clip of its trial."""
        row, is_main = shown[0], shown[0].part == "main"
        numbered = self._versions.get(session, row.version_id).numbered
        answers: tuple[Counted, ...] = ()
        if is_main:
            places = {one.role: numbered[one.version_clip_id] for one in shown if one.role}
            answers = tuple(served(row.kind).counted(places, row.payload))
        return Play(
            row.trial_index,
            is_main,
            row.verdict,
            row.verdict_rule,
            row.method,
            row.rt,
            row.key_to_first_frame_ms,
            answers,
        )


def repair(database: Database, versions: Versions) -> tuple[int, int]:
    """Mend every tally that differs, a run a transaction; return how many were mended, of how many."""
    compared = Recount(versions)
    with database.snapshot() as session:
        wrong = list(compared.differing(session))
    for run in wrong:
        with database.write() as session:
            # Ratings lock the run, too: none comes in between.
            session.execute(select(StudyRun.id).where(StudyRun.id == run).with_for_update())
            counted = compared.counted(session, [run]).get(run)
            session.execute(delete(RunTally).where(RunTally.study_run_id == run))
            if counted is not None:
                session.execute(insert(RunTally).values(study_run_id=run, **counted.values()))
    return len(wrong), compared.runs


def _runs_after(session: Session, after: int) -> Sequence[int]:
    query = select(StudyRun.id).where(StudyRun.id > after).order_by(StudyRun.id).limit(RUNS_AT_ONCE)
    return session.scalars(query).all()


def _stored(session: Session, runs: Sequence[int]) -> dict[int, Tally]:
    columns = (RunTally.study_run_id, RunTally.heat, RunTally.not_good, RunTally.counts, RunTally.answers)
    rows = session.execute(_of(select(*columns), RunTally.study_run_id, runs))
    return {row[0]: tally_of(*row[1:]) for row in rows}


def _of(query: Any, column: Any, runs: Sequence[int]) -> Any:
    return query.where(column.between(runs[0], runs[-1]))
