"""The demonstration of adaptive series, from its TOML to thresholds near the truth by the analysis."""

import csv
import json
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from analysis.cli import app
from experiments.errors import InputError
from experiments.load import load_experiment
from server.context import Services
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.models import Study
from server.rehearsals.person import Truth, truth_of
from tests.conftest import REPOSITORY
from tests.helpers.simulated import take_part
from tests.helpers.studies import add_study

DEMO = REPOSITORY / "experiments" / "threshold-demo.toml"
TRUE_MS = 300.0


@pytest.mark.usefixtures("one_seed")
def test_simulated_people_have_the_thresholds_that_they_were_given(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    if not services.database.is_sqlite:
        pytest.skip("the series themselves are tested on PostgreSQL in test_thresholds.py")
    # Another order of the trials gives another person, and one in some hundred lies outside three errors.
    study = add_study(services, tmp_path / "clips", DEMO.read_text(encoding="utf-8"))
    take_part(client, study, f"threshold={TRUE_MS},spread=60", seeds=(0,), effects_seed=7)
    with services.database.read() as session:
        found = session.query(Study).filter_by(name=study.name).one()
        text = b"".join(FORMATS["csv"](session, found, Extract("all"))).decode()
    rows = [row for row in csv.DictReader(text.splitlines()) if row["counts"] == "1"]
    last = {(row["run"], row["series"]): row for row in rows}
    assert len(last) == 2
    for row in last.values():
        assert abs(float(row["threshold"]) - TRUE_MS) < 3 * float(row["threshold_sd"])
        assert float(row["threshold_sd"]) <= 25 or row["position"] == "30"
    exported, out = tmp_path / "thresholds.csv", tmp_path / "thresholds.json"
    exported.write_text(text, encoding="utf-8")
    options = ["--x", "duration", "--response", "correct", "--guess", "0.02", "--lapse", "0.02"]
    done = CliRunner().invoke(
        app, ["thresholds", str(exported), *options, "--participant", "run", "--json", str(out)]
    )
    assert done.exit_code == 0, done.output
    answer = json.loads(out.read_text(encoding="utf-8"))
    (pooled,) = answer["pooled"].values()
    assert abs(pooled["threshold"] - TRUE_MS) < 3 * pooled["threshold_se"]
    assert pooled["n_trials"] == len(rows)
    fitted = [one["fit"] for one in answer["people"] if one["fit"]]
    assert len(fitted) == 1
    for fit in fitted:
        assert abs(fit["threshold"] - TRUE_MS) < 3 * fit["threshold_se"]


def test_the_truth_is_set_and_faults_are_named() -> None:
    demonstration = load_experiment(str(DEMO))
    assert truth_of(demonstration, "threshold=250, sd=10") == Truth(250.0, (633 - 100) / 8, 10.0, 0.02, 0.02)
    faults = {"treshold=3": "did you mean 'threshold'", "spread=wide": "got 'wide'", "spread=0": "above 0"}
    for text, said in faults.items():
        with pytest.raises(InputError, match=said):
            truth_of(demonstration, text)
