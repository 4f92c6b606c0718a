"""Simulated participants take part in Experiments 1 to 3, every trial, through the real HTTP API."""

import csv
import io
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from experiments import design
from experiments.kinds.clip_rating import RATINGS
from experiments.load import FOLDER
from server.app import create_app
from server.context import Services
from server.core.settings import Settings
from server.exports.formats import ratings_csv
from server.exports.schemas import Extract
from server.models import Rating, Study, StudyRun
from server.rehearsals.http import JsonClient, running_server
from server.rehearsals.person import Person, Rater
from tests.helpers.studies import StudyInDatabase, add_study

PEOPLE = 3


def take_part(address: str, study: StudyInDatabase, link: str, number: int) -> int:
    """One simulated participant; returns how many ratings were sent."""
    with closing(JsonClient(address)) as client:
        person = Person(client, Rater(number, 1, {}))
        assert person.take_part(link)
    return person.ratings


@pytest.mark.parametrize(("name", "trials"), [("exp1", 320), ("exp2", 400), ("exp3", 160)])
def test_three_participants_rate_every_trial(
    services: Services, settings: Settings, tmp_path: Path, name: str, trials: int
) -> None:
    study = add_study(services, tmp_path / "clips", (FOLDER / f"{name}.toml").read_text(), name)
    link = study.link(synthetic=True)
    with running_server(create_app(settings)) as address, ThreadPoolExecutor(PEOPLE) as pool:
        sent = list(pool.map(lambda number: take_part(address, study, link, number), range(PEOPLE)))
    with services.database.read() as session:
        assert Counter(session.scalars(text("SELECT run_status FROM ratings"))) == {"complete": sum(sent)}
        assert session.query(Rating).count() == sum(sent)
        runs = session.query(StudyRun).all()
        assert [run.trials_answered for run in runs] == [trials + study.experiment.practice.trials] * PEOPLE
        rows = session.execute(text("SELECT * FROM ratings ORDER BY run, trial_index, play")).mappings().all()
        simulated = ratings_csv(session, session.query(Study).one(), Extract("simulated"))
        exported = b"".join(simulated).decode("utf-8")
    assert len(rows) == sum(sent)
    assert tuple(rows[0]) == RATINGS.names
    assert all(row["synthetic"] for row in rows)
    last_plays = {(row["run"], row["trial_index"]): row for row in rows if row["kind"] == "main"}
    cells = Counter((row["run"], row["cell"]) for row in last_plays.values())
    assert set(cells.values()) == {trials // len(design.cells(study.experiment))}
    compare_with_csv(rows, exported, list(study.experiment.factor_names))


def compare_with_csv(rows: list, content: str, factors: list[str]) -> None:
    """The CSV holds the view's rows: same number, same values."""
    read = list(csv.DictReader(io.StringIO(content)))
    assert list(read[0]) == RATINGS.csv_header(factors)
    assert len(read) == len(rows)
    by_key = {(row["run"], row["trial_index"], row["play"]): row for row in rows}
    for line in read:
        row = by_key[line["run"], int(line["trial_index"]), int(line["play"])]
        assert line["saved_at"] == row["saved_at"]
        assert line["response"] == str(row["response"])
        assert float(line["rt"]) == row["rt"]
        assert "/".join(line[factor] for factor in factors) == row["cell"]
