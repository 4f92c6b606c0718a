"""Motion checks through the API: asked between trials of every kind, stored, judged, never revealed."""

import csv
import json
import uuid
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.errors import InputError
from experiments.manifest import Manifest
from server.app import create_app
from server.context import Services
from server.core.migrate import current_revision, downgrade, newest_revision
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.models import Study, View
from server.participation.tally_pools import Recount
from server.rehearsals.http import JsonClient, running_server
from server.rehearsals.manners import Actor, act, manner_called
from server.rehearsals.person import Person, Rater
from server.studies.creation import add_version
from server.studies.lookup import active_version
from tests.helpers.databases import run_server_command
from tests.helpers.motion_checks import CHECKS, checked
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback
from tests.helpers.thresholds import TWO_INTERVAL, YES_NO, text_with
from tests.server.trials.test_comparisons import PAIRS
from tests.server.trials.test_continuous import STUDY as TRACES


@pytest.fixture
def study(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", checked(SHORT))


@pytest.fixture
def participant(client: TestClient, study: StudyInDatabase) -> Participant:
    return Participant(client, study.link_token).agree()


def of_kind(state: Any, kind: str) -> list[Any]:
    return [trial for trial in state["trials"] if trial["kind"] == kind]


def answered(participant: Participant, trial: Any, check: int | None, **changes: Any) -> Any:
    answer = {"kind": "check", "check": check, **changes}
    body = {"trial_index": trial["trial_index"], "answer": answer}

    return participant.request("PUT", f"/ratings/{uuid.uuid4()}", body | {"playback": good_playback(trial)})


def right_answers(services: Services, name: str) -> dict[str, int]:
    with services.database.read() as session:
        study = session.query(Study).filter_by(name=name).one()
        manifest = active_version(session, study).manifest
    return {check["sha256"]: check["answer"] for check in manifest["checks"]}


def rows(services: Services, name: str) -> list[dict[str, str]]:
    with services.database.read() as session:
        study = session.query(Study).filter_by(name=name).one()
        text = b"".join(FORMATS["csv"](session, study, Extract("all"))).decode("utf-8-sig")
    return list(csv.DictReader(text.splitlines()))


def test_checks_are_in_every_block_but_never_first_and_none_twice(participant: Participant) -> None:
    state = participant.state()
    blocks: dict[int, list[str]] = {}
    for trial in state["trials"]:
        blocks.setdefault(trial["block"], []).append(trial["kind"])
    assert blocks.pop(0) == ["practice", "practice"]
    assert [kinds.count("check") for kinds in blocks.values()] == [2, 2]
    assert all(kinds[0] == "main" for kinds in blocks.values())
    clips = [trial["clip_sha256"] for trial in of_kind(state, "check")]
    assert len(set(clips)) == 4


def test_the_page_gets_the_same_whatever_the_right_answers_are(
    services: Services, client: TestClient, study: StudyInDatabase, participant: Participant
) -> None:
    """The same clips with other answers: nothing that is sent differs, but who and where."""
    told = {trial["clip_sha256"]: trial for trial in of_kind(participant.state(), "check")}
    with services.database.write() as session:
        row = session.query(Study).filter_by(name=study.name).one()
        manifest = Manifest.model_validate(active_version(session, row).manifest)
        others = [clip.model_copy(update={"answer": 1 + clip.answer % 4}) for clip in manifest.checks]
        changed = manifest.model_copy(update={"checks": tuple(others)})
        add_version(session, row, checked(SHORT), study.experiment, changed, None)
    seen = 0
    for _ in range(6):
        other = Participant(client, study.link_token).agree().state()
        for trial in of_kind(other, "check"):
            first = told.get(trial["clip_sha256"])
            if first is not None:
                seen += 1
                places = ("trial_index", "block")
                assert {**first, **dict.fromkeys(places)} == {**trial, **dict.fromkeys(places)}
        assert other["checks"] == participant.state()["checks"]
    assert seen
    text = json.dumps(participant.state())
    assert "expected_response" not in text
    assert all(word not in json.dumps(list(told.values())) for word in ('"answer"', '"seed"', '"levels"'))


def test_answers_are_kept_apart_and_exported_next_to_the_right_ones(
    services: Services, study: StudyInDatabase, participant: Participant
) -> None:
    right = right_answers(services, study.name)
    participant.answer_forms()
    checks = of_kind(participant.state(), "check")
    first, *others = checks
    assert answered(participant, first, 1 + right[first["clip_sha256"]] % 4).status_code == 201
    for trial in others:
        assert answered(participant, trial, right[trial["clip_sha256"]]).status_code == 201
    participant.rate_all()
    assert participant.request("POST", "/complete").status_code == 200
    exported = [row for row in rows(services, study.name) if row["kind"] == "check"]
    assert [row["check_response"] == row["expected_response"] for row in exported] == [
        False, True, True, True,
    ]  # fmt: skip
    assert {(row["response"], row["scale"], row["cell"], row["speed"]) for row in exported} == {
        ("", "", "", "")
    }
    with services.database.read() as session:
        assert not list(Recount(services.versions).differing(session))


def test_what_is_not_an_answer_to_a_check_is_refused(
    study: StudyInDatabase, participant: Participant
) -> None:
    state = participant.state()
    directions = [one for one in of_kind(state, "check") if one["check"] == "direction"]
    digits = [one for one in of_kind(state, "check") if one["check"] == "digit"]
    trial = (directions or digits)[0]
    most = 4 if directions else 9
    assert answered(participant, trial, most + 1).status_code == 422
    assert answered(participant, trial, 0).status_code == 422
    assert answered(participant, trial, 1, other_way=True).status_code == 422
    other_kind = participant.rate(trial, 4)
    assert (other_kind.status_code, other_kind.json()["error"]["code"]) == (422, "answer_of_other_kind")
    main = of_kind(state, "main")[0]
    wrong = answered(participant, main, 1)
    assert (wrong.status_code, wrong.json()["error"]["code"]) == (422, "answer_of_other_kind")
    assert answered(participant, trial, most).status_code == 201


def test_the_other_way_is_taken_only_where_it_is_offered(
    services: Services, client: TestClient, tmp_path: Path
) -> None:
    plain = CHECKS[: CHECKS.index("[evidence.motion_checks.other_way]")]
    without = add_study(services, tmp_path / "without", checked(SHORT, plain), name="without")
    participant = Participant(client, without.link_token).agree()
    assert participant.state()["checks"]["other_way"] is None
    refused = answered(participant, of_kind(participant.state(), "check")[0], None, other_way=True)
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "no_other_way")


@pytest.mark.parametrize(
    "text",
    [SHORT, PAIRS, text_with(SHORT, YES_NO), TRACES],
    ids=["clip_rating", "paired_comparison", "threshold", "continuous_rating"],
)
def test_every_kind_of_trial_has_checks(services: Services, tmp_path: Path, text: str) -> None:
    study = add_study(services, tmp_path / "clips", checked(text))
    right = right_answers(services, study.name)
    with running_server(create_app(services.settings)) as address:
        client = JsonClient(address)
        person = Person(client, Rater(3, 1, {}, checks=right))
        assert person.take_part(study.link("general", synthetic=True))
        client.close()
    exported = [row for row in rows(services, study.name) if row["kind"] == "check"]
    assert len(exported) == 2 * len({row["block"] for row in exported}) >= 2
    assert all(row["check_response"] for row in exported)
    assert all(row["expected_response"] in map(str, range(1, 10)) for row in exported)


def test_a_view_of_a_check_lasts_as_long_as_its_own_clip(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    """Though the trials of its study show two in turn."""
    study = add_study(services, tmp_path / "clips", checked(text_with(SHORT, TWO_INTERVAL)))
    one = Participant(client, study.link_token).agree()
    check, trial = (of_kind(one.state(), kind)[0] for kind in ("check", "main"))
    seen = [
        {"id": str(uuid.uuid4()), "trial_index": shown["trial_index"], "number": 1, "outcome": "shown"}
        | {"started_at_client": "2026-11-21T10:00:00+00:00", "clips": []}
        for shown in (check, trial)
    ]
    assert one.request("POST", "/views", {"views": seen}).status_code == 200
    with services.database.read() as session:
        lasted = {view.trial_index: view.clip_ms for view in session.query(View)}
    own_ms, of_trial_ms = (1000 * shown["frames"] / shown["fps"] for shown in (check, trial))
    assert lasted[check["trial_index"]] == pytest.approx(own_ms)
    assert lasted[trial["trial_index"]] == pytest.approx(2 * of_trial_ms + 100), "both intervals and the gap"


def test_the_command_simulates_observers_with_checks(services: Services, tmp_path: Path) -> None:
    """Clips of checks are not stimuli of the psychometric function."""
    study = add_study(services, tmp_path / "clips", checked(text_with(SHORT, YES_NO)))
    called = run_server_command(services.settings, "simulate", study.name, "--participants", "1")
    assert (called.returncode, called.stderr.count("Traceback")) == (0, 0), called.stderr
    assert "1 simulated participant," in called.stdout
    kept = [row for row in rows(services, study.name) if row["kind"] == "check"]
    assert kept
    assert all(row["check_response"] for row in kept)


MANNERS = {"honest": "likely", "frames": "unclear", "flow": "unclear", "assistive": "unclear"}


@pytest.mark.parametrize("name", MANNERS)
def test_manners_differ_in_what_they_make_of_checks(services: Services, tmp_path: Path, name: str) -> None:
    """Guesses fail, optical flow passes, and who goes around is unclear at most."""
    eight = CHECKS.replace("per_block = 2", "per_block = 4")
    study = add_study(services, tmp_path / "clips", checked(SHORT, eight), frames=30)
    right = right_answers(services, study.name)
    raters = [Rater(number, 1, {}, checks=right) for number in range(4)]
    runs = act(services.settings, study.link("general", synthetic=True), raters, manner_called(name), 1)
    guessed = [run["signals"]["motion_checks_guessed"] for run in runs]
    assert all(run["verdict"] != "likely" for run in runs) or name == "honest"
    if name in ("honest", "flow"):
        assert sum(value < 0.01 for value in guessed) >= 3
    elif name == "frames":
        assert sum(value >= 0.01 for value in guessed) >= 3
    else:
        assert [run["signals"]["motion_checks_other_way"] for run in runs] == [8] * 4


def escaping(trial: Any, clip: dict[str, Any]) -> dict[str, Any]:
    """A check whose clip is said not to have been shown."""
    return {"answer": {"kind": "check", "check": None}, "playback": {"method": "none"}}


def distracted(trial: Any, clip: dict[str, Any]) -> dict[str, Any]:
    """A check that is answered, in a window said to have lost the focus."""
    return {"answer": {"kind": "check", "check": 1}, "playback": {**clip, "focus_lost": 1}}


@pytest.mark.parametrize("way", [escaping, distracted])
def test_no_run_is_likely_a_person_s_whose_checks_all_say_nothing(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: Any
) -> None:
    eight = CHECKS.replace("per_block = 2", "per_block = 4")
    study = add_study(services, tmp_path / "clips", checked(SHORT, eight), frames=30)
    monkeypatch.setattr(Actor, "_checked", lambda actor, trial: way(trial, actor._playback(trial)))
    raters = [Rater(1, 1, {}, checks=right_answers(services, study.name))]
    manner = replace(manner_called("honest"), offline=0, reloads=0, clock_jumps=0)
    [run] = act(services.settings, study.link("general", synthetic=True), raters, manner, 1)
    assert run["refused"] == {}
    assert run["signals"]["motion_checks_void"] == 8
    assert run["verdict"] == "unclear"


def test_a_study_is_not_taken_in_without_the_checks_it_asks_for(
    services: Services, study: StudyInDatabase
) -> None:
    with services.database.write() as session:
        row = session.query(Study).filter_by(name=study.name).one()
        manifest = Manifest.model_validate(active_version(session, row).manifest)
        with pytest.raises(InputError, match="at least 4 motion checks"):
            add_version(
                session,
                row,
                checked(SHORT),
                study.experiment,
                manifest.model_copy(update={"checks": ()}),
                None,
            )


def test_no_downgrade_takes_answers_to_checks(
    services: Services, study: StudyInDatabase, participant: Participant
) -> None:
    participant.answer_forms()
    trial = of_kind(participant.state(), "check")[0]
    assert answered(participant, trial, 1).status_code == 201
    with pytest.raises(RuntimeError, match="Answers to motion checks are stored"):
        downgrade(services.database, "0017")
    assert current_revision(services.database) == newest_revision()
    assert len([row for row in rows(services, study.name) if row["kind"] == "check"]) == 1
