"""Short studies in a server's database, and a participant of the API for tests."""

import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from starlette.testclient import TestClient as StarletteClient

from experiments.declaration.clip_rating import SCALE_NAME
from experiments.declaration.experiment import Experiment
from experiments.load import parse_experiment
from server.app import create_app
from server.context import Services
from server.core.values import derived_token
from server.models import Link, Study
from server.studies.creation import add_version, create_study, store_clips
from server.studies.links import PURPOSE, LinkKind, create_link
from tests.helpers.tiny_clips import make_clip_folder

SHORT = """
name = "short"
title = "A short study"
languages = ["en", "de"]

[[factors]]
name = "character"
label = "Character"
levels = [{ name = "a", label = "A" }, { name = "b", label = "B" }]

[[factors]]
name = "speed"
label = "Speed"
levels = [{ name = "slow", label = "Slow" }, { name = "fast", label = "Fast" }]

[exemplars]
per_cell = 2

[blocks]
split_by = "character"
order = "alternating"

[practice]
trials = 2

[attention]
per_block = 1

[session]
lease_minutes = 60

[trial]
kind = "clip_rating"

[trial.scale]
question = { en = "How natural?", de = "Wie natürlich?" }
low = { en = "not at all", de = "gar nicht" }
high = { en = "very", de = "sehr" }

[[exclusions]]
rule = "attention_checks_failed"

[[forms]]
name = "about"
title = { en = "About you" }
[[forms.fields]]
type = "number"
name = "age"
label = { en = "Age" }
required = true
minimum = 18
maximum = 120
[[forms.fields]]
type = "multiple_choice"
name = "glasses"
label = { en = "What do you wear?" }
options = [{ value = "glasses", label = { en = "Glasses" } }, { value = "lenses", label = { en = "Lenses" } }]

[texts.en]
consent = "Do you agree?"
instructions = "Look."
debrief = "Thanks."

[texts.de]
consent = "Einverstanden?"
instructions = "Schauen."
debrief = "Danke."
"""


@dataclass
class StudyInDatabase:
    """A live study with its general link."""

    services: Services
    name: str
    experiment: Experiment
    link_token: str

    def link(self, kind: LinkKind = "general", **options: Any) -> str:
        """The token of a new link."""
        with self.services.database.write() as session:
            study = session.query(Study).filter_by(name=self.name).one()
            link = create_link(session, self.services.settings.key, study, kind, **options)
            return link_token(self.services, link)

    def change(self, **values: Any) -> None:
        """Change columns of the study."""
        with self.services.database.write() as session:
            session.query(Study).filter_by(name=self.name).update(values)


def link_token(services: Services, link: Link) -> str:
    """The token of a stored link."""
    return derived_token(services.settings.key, PURPOSE, link.public_id)


def add_study(
    services: Services,
    folder: Path,
    text: str = SHORT,
    name: str = "",
    status: str = "live",
    frames: int = 4,
    clip_bytes: int = 0,
    blinks_s: tuple[float, ...] = (),
) -> StudyInDatabase:
    """Make tiny clips for a declaration (at least `clip_bytes` each), and take both in."""
    experiment = parse_experiment(text)
    manifest = make_clip_folder(experiment, folder, frames=frames, clip_bytes=clip_bytes, blinks_s=blinks_s)
    store_clips(services.clips, manifest, folder)
    with services.database.write() as session:
        study = create_study(session, name or experiment.name, experiment, None)
        add_version(session, study, text, experiment, manifest, None)
        study.status = status
        link = create_link(session, services.settings.key, study, "general")
        token = link_token(services, link)
    return StudyInDatabase(services, name or experiment.name, experiment, token)


class Participant:
    """One participant's requests."""

    def __init__(self, client: StarletteClient, link: str) -> None:
        self.client, self.link = client, link
        self.client_id = str(uuid.uuid4())
        self.token = ""
        self.run_id = ""

    def start(self, **values: Any) -> Any:
        """Begin the run; returns the response."""
        body = {"language": "en", "client_id": self.client_id, **values}
        response = self.client.post(f"/api/links/{self.link}/runs", json=body)
        if response.status_code < 300:
            self.token, self.run_id = response.json()["run_token"], response.json()["run_id"]
        return response

    def request(self, method: str, path: str, body: Any = None) -> Any:
        """A request with the run token."""
        headers = {"authorization": f"Bearer {self.token}", "accept": "application/json"}
        return self.client.request(method, f"/api/run{path}", json=body, headers=headers)

    def state(self) -> Any:
        """GET /api/run."""
        return self.request("GET", "").json()

    def agree(self) -> "Participant":
        """Begin and agree to take part."""
        assert self.start().status_code == 201
        assert self.request("PUT", "/consent", {"agreed": True}).status_code == 200
        return self

    def rate(
        self, trial: Any, response: float | None = 4, rating_id: str | None = None, **changes: Any
    ) -> Any:
        """Send one rating; `changes` replace parts of the body, `playback` those of the play."""
        playback = {**good_playback(trial), **changes.pop("playback", {})}
        body = {"trial_index": trial["trial_index"], "play": 1, "answer": rated(response), "rt": 700.5}
        body |= {"time_elapsed": 1000.0 * (trial["trial_index"] + 1), "playback": playback} | changes
        return self.request("PUT", f"/ratings/{rating_id or uuid.uuid4()}", body)

    def answer_forms(self, **changes: Any) -> None:
        """Answer the form of the short study."""
        assert self.request("PUT", "/forms/about", {"answers": {"age": 30} | changes}).status_code == 200

    def answer_all(self) -> None:
        """Everything a run needs to be complete: the form and the trials."""
        self.answer_forms()
        self.rate_all()

    def rate_all(self) -> None:
        """Rate every trial, attention checks as asked."""
        for trial in self.state()["trials"]:
            if not trial["answered"]:
                asked = [
                    int(word) for word in (trial["prompt"] or "").replace("*", " ").split() if word.isdigit()
                ]
                assert self.rate(trial, *asked[:1]).status_code == 201


def rated(response: float | None) -> dict[str, Any]:
    """The answer to a trial with one scale."""
    return {"kind": "clip_rating", "answers": {SCALE_NAME: {"response": response}}}


def clip_url(trial: Any) -> str:
    """Where the clip of a trial is."""
    return f"/clips/{trial['clip_sha256']}.mp4"


def good_playback(trial: Any) -> dict[str, Any]:
    """A play with every frame in time, or none where the trial has no clip."""
    if trial["clip_sha256"] is None:
        return {"method": "none"}
    return {
        "method": "webcodecs",
        "clip_sha256": trial["clip_sha256"],
        "key_to_first_frame_ms": 9.5,
        "frames_drawn": trial["frames"],
        "frames_late": 0,
        "frames_missing": 0,
        "longest_gap_ms": 34.0,
        "clock_gap_ms": 17.4,
        "clock_late_ms": 0.8,
        "stalls": 0,
        "focus_lost": 0,
        "refresh_rate_hz": 60.0,
        "device_pixel_ratio": 2.0,
        "drawn": [[index, 10 + 33.3 * index] for index in range(trial["frames"])],
    }


FROM_OWN_PAGE = {"sec-fetch-site": "same-origin"}
"""What every browser adds to the requests of a server's pages."""
_built: list[FastAPI] = []
"""The application, built once: putting all routes together takes longer than a test."""


@pytest.fixture
def client(services: Services) -> Iterator[TestClient]:
    """A client of the application on this test's database and clip store."""
    if not _built:
        _built.append(create_app(services.settings))
    app = _built[0]
    app.state.services = services
    with TestClient(app, raise_server_exceptions=False, headers=FROM_OWN_PAGE) as opened:
        yield opened


@pytest.fixture
def study(services: Services, quick_folder: Path) -> StudyInDatabase:
    """The short study, live: 2 practice trials, 8 clips in 2 blocks, one attention check per block."""
    return add_study(services, quick_folder / "clips")


@pytest.fixture
def participant(client: TestClient, study: StudyInDatabase) -> Participant:
    """A participant of the short study who has not begun."""
    return Participant(client, study.link_token)
