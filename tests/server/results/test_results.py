import math

import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from server.results.summary import margin, raters_of_same_cells
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase


def test_margins_and_distributions_of_a_complete_run(viewer: Admin, participant: Participant) -> None:
    participant.agree()
    for trial in participant.state()["trials"]:
        participant.rate(trial, 6)
    shown = viewer.get("/studies/short/results").json()
    assert (shown["participants"], shown["ratings"]) == (1, 8)
    assert [entry["factors"] for entry in shown["margins"]] == [
        ["character"],
        ["speed"],
        ["character", "speed"],
    ]
    assert {mean["mean"] for entry in shown["margins"] for mean in entry["means"]} == {6.0}
    assert all(cell["counts"] == [0, 0, 0, 0, 0, 2, 0] for cell in shown["cells"])
    assert sum(entry["answers"] for entry in shown["response_times"]) == 8


def test_excluded_runs_do_not_count(experimenter: Admin, participant: Participant) -> None:
    participant.agree().rate_all()
    experimenter.send("PUT", f"/studies/short/runs/{participant.run_id}/exclusion", {"reason": "test"})
    assert experimenter.get("/studies/short/results").json()["participants"] == 0


def test_answers_before_and_after_another_scale_are_apart(
    experimenter: Admin, client: TestClient, participant: Participant, study: StudyInDatabase
) -> None:
    participant.agree().rate_all()
    changed = SHORT.replace("[trial.scale]\n", "[trial.scale]\nmaximum = 5\n")
    for toml in (SHORT.replace("Thanks.", "Thank you."), changed):
        revision = experimenter.get("/studies/short").json()["summary"]["revision"]
        body = {"revision": revision, "toml": toml, "note": ""}
        assert experimenter.send("POST", "/studies/short/versions", body).status_code == 201
    Participant(client, study.link_token).agree().rate_all()
    series = experimenter.get("/studies/short").json()["series"]
    assert [(one["number"], one["versions"], one["runs"]) for one in series] == [
        (1, [1, 2], {"participant": 1}),
        (2, [3], {"participant": 1}),
    ]
    latest = experimenter.get("/studies/short/results").json()
    first = experimenter.get("/studies/short/results?series=1").json()
    assert [
        (shown["series"], shown["scale"]["maximum"], shown["participants"]) for shown in (latest, first)
    ] == [
        (2, 5, 1),
        (1, 7, 1),
    ]
    assert experimenter.get("/studies/short/results?origin=pilot").json()["participants"] == 0
    assert experimenter.get("/studies/short/results?series=3").status_code == 404


def test_an_empty_study_has_empty_results(viewer: Admin, study: StudyInDatabase) -> None:
    shown = viewer.get("/studies/short/results").json()
    assert shown["ratings"] == 0
    assert len(shown["clips"]) == 8


def test_error_bars_are_cousineau_morey() -> None:
    # three participants, two conditions, by hand: differences 1, 2, 3; sd of a difference 1;
    # the SE of a condition is sd(differences) / 2 / sqrt(3) * sqrt(2)
    rows = {"a": {("x",): 1.0, ("y",): 2.0}, "b": {("x",): 3.0, ("y",): 5.0}, "c": {("x",): 2.0, ("y",): 5.0}}
    first, second = margin(raters_of_same_cells(rows), ["f"], ["f"])
    assert (first.mean, second.mean) == (2.0, 4.0)
    assert first.se_within == pytest.approx(math.sqrt(2) / 2 / math.sqrt(3))


@hypothesis_settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-50, 50), min_size=2, max_size=8), st.data())
def test_a_constant_per_participant_changes_no_error_bar(offsets: list[float], data: st.DataObject) -> None:
    scores = [data.draw(st.tuples(st.floats(1, 7), st.floats(1, 7), st.floats(1, 7))) for _ in offsets]
    levels = [("x",), ("y",), ("z",)]
    plain = {str(n): dict(zip(levels, row, strict=True)) for n, row in enumerate(scores)}
    moved = {n: {k: v + offsets[int(n)] for k, v in row.items()} for n, row in plain.items()}
    one, two = (
        margin(raters_of_same_cells(plain), ["f"], ["f"]),
        margin(raters_of_same_cells(moved), ["f"], ["f"]),
    )
    for a, b in zip(one, two, strict=True):
        assert a.se_within == pytest.approx(b.se_within, abs=1e-9)


def test_groups_of_participants_have_means_and_errors_of_their_own() -> None:
    rows = {
        "a": {("near", "x"): 2.0, ("near", "y"): 4.0},
        "b": {("near", "x"): 4.0, ("near", "y"): 6.0},
        "c": {("far", "x"): 1.0, ("far", "y"): 1.0},
    }
    near, far = margin(raters_of_same_cells(rows), ["view", "form"], ["view"], ["view"])
    assert (near.levels, near.mean, near.participants) == ({"view": "near"}, 4.0, 2)
    assert near.se_within == pytest.approx(1.0)
    assert (far.levels, far.mean, far.participants, far.se_within) == ({"view": "far"}, 1.0, 1, None)
    both = margin(raters_of_same_cells(rows), ["view", "form"], ["view", "form"], ["view"])
    assert [(one.levels["view"], one.mean) for one in both] == [
        ("near", 3),
        ("near", 5),
        ("far", 1),
        ("far", 1),
    ]
    assert [one.mean for one in margin(raters_of_same_cells(rows), ["view", "form"], ["form"], ["view"])] == [
        7 / 3,
        11 / 3,
    ]
