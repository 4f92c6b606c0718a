"""Results of continuous ratings, against the analysis of the exported rows and against scipy."""

import numpy as np
import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from analysis.plans.continuous_rating import cell_traces, clips_of
from analysis.plans.plan import plan_of, prepare
from analysis.read.study_answers import load_csv
from server.context import Services
from server.core.values import now
from server.models import StudyRun
from server.results.summary import MAX_POINTS, Trace, cell_trace, student_t
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase
from tests.server.trials.test_continuous import BLINKS_S, exported, send, study

__all__ = ["study"]
PEOPLE = 4


@pytest.mark.parametrize("df", [1, 2, 3, 4, 7, 30, 200, 201, 5000])
def test_the_t_quantile_is_scipys(df: int) -> None:
    assert student_t(df) == pytest.approx(stats.t.ppf(0.975, df), abs=1e-4)


@given(st.integers(1, 2000), st.integers(1, 3))
def test_a_long_trace_has_no_more_points_than_a_figure_shows(samples: int, people: int) -> None:
    made = cell_trace([Trace(run, "a", 0.1, [float(run)] * samples) for run in range(people)])
    assert len(made.times_s) == len(made.mean) <= MAX_POINTS
    assert len(set(np.round(np.diff(made.times_s), 3))) <= 1
    assert (made.low is None) == (people == 1)


def test_traces_of_another_rate_are_counted_and_left_out() -> None:
    made = cell_trace(
        [Trace(1, "a", 0.1, [1, 2, 3]), Trace(2, "a", 0.12, [5, 5]), Trace(3, "a", 0.1, [3, 4])]
    )
    assert (made.traces, made.left_out, made.people) == (2, 1, 2)
    assert made.mean == [2.0, 3.0]


@pytest.fixture
def answered(client: TestClient, study: StudyInDatabase) -> StudyInDatabase:
    for number in range(PEOPLE):
        participant = Participant(client, study.link_token).agree()
        for trial in participant.state()["trials"]:
            if trial["kind"] != "main":
                continue
            place = 7 * number + trial["trial_index"]
            values = [50.0 + (index * (place + 1)) % 13 for index in range(100)]
            assert send(participant, trial, {"values": values, "step_frames": 3}).status_code == 201
    return study


def test_mean_traces_are_those_of_the_analysis(
    answered: StudyInDatabase, services: Services, viewer: Admin, tmp_path
) -> None:
    shown = viewer.get("/studies/short/results").json()
    path = tmp_path / "traces.csv"
    path.write_bytes(exported(services, "participant"))
    plan = plan_of("continuous_rating")
    prepared = prepare(answered.experiment, plan, load_csv(path, answered.experiment, plan.reading))
    reckoned = {trace.cell: trace for trace in cell_traces(answered.experiment, clips_of(prepared))}
    assert [cell["cell"] for cell in shown["cells"]] == list(reckoned)
    for cell in shown["cells"]:
        expected = reckoned[cell["cell"]]
        assert cell["people"] == expected.people
        for name in ("times_s", "mean"):
            assert cell[name] == pytest.approx(getattr(expected, name), abs=1e-4)
        assert cell["low"] == pytest.approx(expected.ci_low, abs=1e-3)
        assert cell["high"] == pytest.approx(expected.ci_high, abs=1e-3)
        assert cell["level"] == pytest.approx(expected.level, abs=1e-4)
        assert cell["blinks_s"] == [list(BLINKS_S)]


def test_excluded_people_are_left_out(answered: StudyInDatabase, services: Services, viewer: Admin) -> None:
    before = viewer.get("/studies/short/results").json()
    with services.database.write() as session:
        run = session.query(StudyRun).first()
        assert run is not None
        run.excluded, run.excluded_at = True, now()
    after = viewer.get("/studies/short/results").json()
    assert [one["people"] - 1 for one in before["cells"]] == [one["people"] for one in after["cells"]]
