"""Each template for one's own clips becomes a study that a participant can take part in."""

import tomllib
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.studies.own_clips import trial_of
from server.studies.schemas import OwnClips
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant
from tests.helpers.tiny_clips import encoded_video
from tests.helpers.uploads import upload

FILES = [f"blink_{duration}_{number}.mp4" for duration in (100, 167, 233, 300, 367) for number in (1, 2)]


def own_study(experimenter: Admin, template: str, files: list[str]) -> Any:
    video = encoded_video(4, 30) + bytes([0, 0, 0, 9]) + b"free"
    sent = [(name, video + bytes([place])) for place, name in enumerate(files)]
    received = upload(experimenter, *sent).json()
    body = {
        "name": "own", "upload": received["id"], "levels": {"pattern": "blink_{duration}_{exemplar}.mp4"},
        "own_clips": {"title": "Own", "question": "Which?", "template": template},
    }  # fmt: skip
    return experimenter.send("POST", "/studies", body)


@pytest.mark.parametrize(
    ("template", "trials"),
    [
        ("rating", 10),
        ("slider", 10),
        ("sliders", 10),
        ("acr", 10),
        ("dcr", 10),
        ("pairs", 20),
        ("just_noticeable", 40),
    ],
)
def test_a_template_is_a_study_that_can_be_taken_part_in(
    client: TestClient, experimenter: Admin, template: str, trials: int
) -> None:
    made = own_study(experimenter, template, FILES)
    assert made.status_code == 201, made.text
    assert made.json()["design"]["trials_per_participant"] == trials
    consent = tomllib.loads(made.json()["toml"])["texts"]["en"]["consent"]
    task = "compare two at a time" if template in ("pairs", "just_noticeable") else "rate each of them"
    assert f"watch short clips and {task}." in consent
    link = experimenter.send(
        "POST", "/studies/own/links", {"kind": "preview", "labels": [], "count": 1}
    ).json()
    token = link[0]["url"].rsplit("/", 1)[1]
    person = Participant(client, token).agree()
    assert person.state()["trials"]


def test_categories_are_those_of_p910_worst_first(experimenter: Admin) -> None:
    scale = tomllib.loads(own_study(experimenter, "acr", FILES).json()["toml"])["trial"]["scale"]
    assert [label["en"] for label in scale["labels"]] == ["Bad", "Poor", "Fair", "Good", "Excellent"]
    assert (scale["minimum"], scale["maximum"]) == (1, 5)


@pytest.mark.parametrize(("first", "level"), [("100", "100"), ("reference", "reference")])
def test_the_reference_is_the_level_of_this_name_or_the_first(
    experimenter: Admin, first: str, level: str
) -> None:
    files = [f"blink_{duration}_{number}.mp4" for duration in (first, "167") for number in (1, 2)]
    trial = tomllib.loads(own_study(experimenter, "dcr", files).json()["toml"])["trial"]
    assert (trial["reference"]["factor"], trial["reference"]["level"]) == ("duration", level)
    assert trial["scale"]["labels"][4]["en"] == "Imperceptible"


def test_the_standard_is_the_lowest_number(experimenter: Admin) -> None:
    trial = tomllib.loads(own_study(experimenter, "just_noticeable", FILES).json()["toml"])["trial"]
    assert (trial["stimulus"]["factor"], trial["task"]["standard"]) == ("duration", "100")


@pytest.mark.parametrize("words", [("slow", "middle", "fast", "faster"), ("1", "2")])
def test_a_just_noticeable_difference_needs_numbers(experimenter: Admin, words: tuple[str, ...]) -> None:
    files = [f"blink_{word}_{number}.mp4" for word in words for number in (1, 2)]
    refused = own_study(experimenter, "just_noticeable", files)
    assert (refused.status_code, "all numbers" in refused.json()["error"]["message"]) == (422, True)


@pytest.mark.parametrize(
    ("question", "name"),
    [
        ("How natural was this clip?", "natural"),
        ("How alive is it?", "alive"),
        ("How much did you like it?", "rating"),
        ("Wie lebendig ist das?", "rating"),
    ],
)
def test_a_slider_is_named_by_its_question(question: str, name: str) -> None:
    trial = trial_of(OwnClips(template="sliders", title="Own", question=question), {})
    assert [scale["name"] for scale in trial["scales"]] == [name, "pleasant"]
    alone = trial_of(OwnClips(template="slider", title="Own", question=question), {})
    assert alone["scale"] == trial["scales"][0]
