"""Paired comparisons through the API: assigned by role, judged on both clips, stored, exported, simulated."""

import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.models import RunTally, Study
from server.participation.tallies import tally_of, unpack_answer
from server.participation.tally_pools import Recount
from server.rehearsals.person import Person, Rater
from tests.helpers.admins import Admin
from tests.helpers.comparisons import comparisons
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback

PAIRS = (
    SHORT[: SHORT.index("[trial]")].replace('split_by = "character"\norder = "alternating"', "repeats = 2")
    + """
[trial]
kind = "paired_comparison"
question = { en = "Which?", de = "Welcher?" }
pairs = { among = "within", factor = "character" }
presentation = { arrangement = "side_by_side", if_too_narrow = "stack" }
ties = { label = { en = "Neither", de = "Keiner" } }
"""
    + SHORT[SHORT.index("[[exclusions]]") :]
)

LEFT = {"kind": "paired_comparison", "winner": "left", "arrangement": "side_by_side"}


@pytest.fixture
def pairs(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", PAIRS)


@pytest.fixture
def judge(client: TestClient, pairs: StudyInDatabase) -> Participant:
    return Participant(client, pairs.link_token).agree()


def mains(participant: Participant) -> list[Any]:
    return [trial for trial in participant.state()["trials"] if trial["kind"] == "main"]


def play_of(trial: Any, **changes: Any) -> dict[str, Any]:
    clips = {
        clip["role"]: {
            "clip_sha256": clip["clip_sha256"],
            "frames_drawn": clip["frames"],
            "frames_missing": 0,
        }
        for clip in trial["clips"]
    }
    return {**good_playback(trial), "clips": clips, **changes}


def compare(
    participant: Participant, trial: Any, winner: str | None, rating_id: str = "", **changes: Any
) -> Any:
    body = {
        "trial_index": trial["trial_index"],
        "play": 1,
        "answer": {"kind": "paired_comparison", "winner": winner, "arrangement": "side_by_side"},
        "rt": 700.5,
        "playback": play_of(trial),
        **changes,
    }
    return participant.request("PUT", f"/ratings/{rating_id or uuid.uuid4()}", body)


def stored(services: Services) -> Sequence[Mapping[str, Any]]:
    with services.database.read() as session:
        return comparisons(session)


def test_a_comparison_is_stored_with_both_clips_and_the_winner(
    judge: Participant, services: Services
) -> None:
    trial = mains(judge)[0]
    assert [clip["role"] for clip in trial["clips"]] == ["left", "right"]
    answer = compare(judge, trial, "right")
    assert answer.status_code == 201, answer.text
    receipt = answer.json()["receipt"]
    assert (receipt["verdict"], receipt["rule"]) == ("good", "")
    (row,) = stored(services)
    assert (row["winner"], row["arrangement"], row["rt"]) == ("right", "side_by_side", 700.5)
    assert {row["left_cell"].split("/")[0], row["right_cell"].split("/")[0]} == {"a", "b"}
    assert row["left_cell"].split("/")[1] == row["right_cell"].split("/")[1]
    assert row["left_exemplar"] == row["right_exemplar"]
    assert [row["left_clip_sha256"], row["right_clip_sha256"]] == [
        clip["clip_sha256"] for clip in trial["clips"]
    ]


def test_the_same_again_is_stored_once_and_another_answer_refused(judge: Participant) -> None:
    trial, name = mains(judge)[0], str(uuid.uuid4())
    codes = [compare(judge, trial, winner, name).status_code for winner in ("left", "left", "tie")]
    assert codes == [201, 200, 409]


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"answer": {**LEFT, "winner": "middle"}}, "invalid"),
        ({"answer": {**LEFT, "arrangement": "one_after_the_other"}}, "no_comparison"),
        ({"answer": {**LEFT, "more": "x"}}, "invalid"),
        ({"answer": None}, "invalid"),
        ({"answer": {**LEFT, "kind": "no_such_kind"}}, "invalid"),
        ({"answer": {"kind": "clip_rating", "answers": {"x": {"response": 3}}}}, "answer_of_other_kind"),
    ],
)
def test_what_is_not_an_answer_to_a_pair_is_refused_in_one_line(
    judge: Participant, services: Services, changes: dict[str, Any], code: str
) -> None:
    answer = compare(judge, mains(judge)[0], "left", **changes)
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, code)
    assert "\n" not in answer.json()["error"]["message"]
    assert stored(services) == []


def test_a_tie_is_refused_where_none_is_declared(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    without = PAIRS.replace('ties = { label = { en = "Neither", de = "Keiner" } }\n', "")
    study = add_study(services, tmp_path / "clips", without)
    judge = Participant(client, study.link_token).agree()
    trial = mains(judge)[0]
    assert compare(judge, trial, "tie").json()["error"]["code"] == "no_comparison"
    assert compare(judge, trial, "left").status_code == 201


def test_both_clips_are_judged(judge: Participant) -> None:
    first, second, third = mains(judge)[:3]
    clips = play_of(first)["clips"]
    swapped = {"left": clips["right"], "right": clips["left"]}
    wrong = compare(judge, first, "left", playback=play_of(first, clips=swapped)).json()["receipt"]
    assert (wrong["verdict"], wrong["rule"], wrong["again"]) == ("failed", "wrong_clip", True)
    clips = play_of(second)["clips"]
    clips["right"]["frames_drawn"] -= 1
    less = compare(judge, second, "left", playback=play_of(second, clips=clips)).json()["receipt"]
    assert (less["verdict"], less["rule"]) == ("flagged", "frame_log_disagrees")
    missing = compare(judge, third, "left", playback=play_of(third, clips=None)).json()["receipt"]
    assert (missing["verdict"], missing["rule"]) == ("failed", "wrong_clip")


def test_simulated_people_compare_to_the_end_and_the_csv_has_their_answers(
    client: TestClient, services: Services, pairs: StudyInDatabase
) -> None:
    link = pairs.link(synthetic=True)
    person = Person(Api(client), Rater(1, 1, {}))
    assert person.take_part(link)
    rows = stored(services)
    main = [row for row in rows if row["kind"] == "main"]
    assert {row["winner"] for row in main} <= {"left", "right", "tie"}
    assert all(row["run_origin"] == "simulated" for row in rows)
    checks = [row for row in rows if row["kind"] == "attention"]
    assert checks
    assert all(["left", "right", "tie"].index(r["winner"]) + 1 == r["expected_response"] for r in checks)
    with services.database.read() as session:
        study = session.query(Study).filter_by(name=pairs.name).one()
        lines = b"".join(FORMATS["csv"](session, study, Extract("all"))).decode().splitlines()
        codebook = b"".join(FORMATS["codebook"](session, study, Extract("all"))).decode()
    assert len(lines) == 1 + len(rows)
    assert {"left_cell", "right_cell", "winner", "verdict", "participant"} <= set(lines[0].split(","))
    assert "| winner | text |" in codebook
    assert "Question: Which? Answers: left, right or tie (Neither)." in codebook


def test_a_comparison_is_counted_by_its_two_clips(judge: Participant, services: Services) -> None:
    trials = mains(judge)
    for trial, winner in zip(trials, ("left", "right", "tie"), strict=False):
        assert compare(judge, trial, winner).status_code == 201
    with services.database.read() as session:
        assert list(Recount(services.versions).differing(session)) == []
        row = session.query(RunTally).one()
    tally = tally_of(row.heat, row.not_good, row.counts, row.answers)
    version = next(iter(services.versions._loaded.values()))
    hashes = [version.clips[clip].sha256 for clip in version.numbered]
    counted = [unpack_answer(code) for code in tally.answers[""]]
    assert [(hashes[left], hashes[right], value) for left, right, value in counted] == [
        (trial["clips"][0]["clip_sha256"], trial["clips"][1]["clip_sha256"], value)
        for trial, value in zip(trials, (1, 2, 3), strict=False)
    ]
    assert tally.cells == {}


IN_GROUPS = PAIRS.replace('label = "Character"', 'label = "Character"\nbetween = true').replace(
    'factor = "character"', 'factor = "speed"'
)


def test_people_of_two_groups_compare_the_clips_of_their_own(
    services: Services, client: TestClient, viewer: Admin, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", IN_GROUPS)
    for _ in range(2):
        person = Participant(client, study.link_token).agree()
        for trial in mains(person):
            assert compare(person, trial, "left").status_code == 201
    with services.database.read() as session:
        rows = [row for row in comparisons(session) if row["kind"] == "main"]
    cells: dict[str, set[str]] = {}
    for row in rows:
        cells.setdefault(row["run"], set()).update((row["left_cell"], row["right_cell"]))
    assert sorted(map(sorted, cells.values())) == [["a/fast", "a/slow"], ["b/fast", "b/slow"]]
    shown = viewer.get("/studies/short/results").json()
    assert [(pair["first"], pair["second"]) for pair in shown["pairs"]] == [
        ("a/slow", "a/fast"),
        ("b/slow", "b/fast"),
    ]
