"""A kind of trial with several clips and its own answer is stored without a separate table."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from experiments.declaration.any_trial import TRIALS
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from server.context import Services
from server.core.migrate import upgrade
from server.models import Rating, StudyRun, TrialClip
from tests.experiments.trials.toy import TOY
from tests.helpers.studies import SHORT, Participant, add_study


@pytest.fixture
def toy(services: Services) -> Iterator[None]:
    """The tests' own kind, registered for one test; its view comes and goes with it, as at a start."""
    KINDS[TOY.name], TRIALS[TOY.name] = TOY, TOY.declaration
    Experiment.model_rebuild(force=True)
    upgrade(services.database)
    yield
    del KINDS[TOY.name], TRIALS[TOY.name]
    Experiment.model_rebuild(force=True)
    upgrade(services.database)


@pytest.mark.usefixtures("toy")
def test_its_clips_are_rows_by_role_and_its_view_shows_its_answers(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    declared = re.sub(r"(?s)\[trial\].*?(?=\[\[exclusions)", lambda _: TOY.example + "\n", SHORT)
    study = add_study(services, tmp_path / "clips", declared)
    participant = Participant(client, study.link_token)
    assert participant.start().status_code == 201
    with services.database.write() as session:
        run = session.query(StudyRun).one()
        loaded = services.versions.get(session, run.version_id)
        assigned = TOY.assign(loaded.experiment, run.seed, run.slot)
        clips = session.query(TrialClip).order_by(TrialClip.trial_index, TrialClip.position).all()
        assert [(clip.trial_index, clip.role, clip.position, clip.version_clip_id) for clip in clips] == [
            (index, shown.role, position, loaded.places[shown.clip.cell, shown.clip.exemplar])
            for index, trial in enumerate(assigned)
            for position, shown in enumerate(trial.shown)
        ]
        for index, same in enumerate([True, False]):
            session.add(_answer(run, index, {"same": same}))
        firsts = [shown.clip.cell for trial in assigned[:2] for shown in trial.shown if shown.role == "first"]
    with services.database.read() as session:
        query = text("SELECT same, first_cell FROM sameness ORDER BY same DESC")
        assert [(bool(same), cell) for same, cell in session.execute(query)] == [
            (True, firsts[0]),
            (False, firsts[1]),
        ]
        assert session.scalar(text("SELECT count(*) FROM ratings")) == 0


def _answer(run: StudyRun, index: int, payload: dict[str, bool]) -> Rating:
    return Rating(
        rating_id=str(index),
        study_run_id=run.id,
        trial_index=index,
        play=1,
        kind=TOY.name,
        payload=payload,
        method="webcodecs",
        verdict="good",
    )
