"""One list of planted faults of design, clips and server: each is named before the study is live."""

import dataclasses
import hashlib
import io
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import av
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from server.context import Services
from server.core.settings import Settings
from server.models import Job, Link, Study, StudyVersion
from server.operations.backup_stores import NAMES
from tests.helpers.admins import Admin
from tests.helpers.motion_checks import checked
from tests.helpers.studies import Participant, StudyInDatabase, add_study
from tests.helpers.tiny_clips import encoded_video
from tests.server.studies.test_launch_checks import (
    READY,
    changed,
    declare_clip,
    declare_frames,
    declare_other_bytes,
    flip_byte,
    lose_clip,
    opened,
)

GOOD = changed(READY, 'languages = ["en", "de"]', 'languages = ["en"]')
"""A declaration that nothing speaks against."""
TWO_LANGUAGES = ('languages = ["en"]', 'languages = ["en", "de"]')
ADDRESS = "https://studies.example.org"
DAY_S = 86400.0


@dataclass
class Ground:
    """A study that is ready to go live, and the server around it, for a fault to be planted in."""

    owner: Admin
    client: TestClient
    services: Services
    study: StudyInDatabase
    backups: Path
    monkeypatch: pytest.MonkeyPatch

    def set_settings(self, **values: Any) -> None:
        """Put the server's settings in place, or change some of them."""
        settings = Settings(**self.services.settings.model_dump() | values)
        self.services = dataclasses.replace(self.services, settings=settings)
        assert isinstance(self.client.app, FastAPI)
        self.client.app.state.services = self.services

    def recruit(self, **recruiter: str) -> None:
        """Recruit by a service."""
        self.study.change(recruiter=recruiter)

    def first_clip(self) -> str:
        """The SHA-256 of a clip."""
        with self.services.database.read() as session:
            return str(session.query(StudyVersion).one().manifest["clips"][0]["sha256"])

    def change_fast_clips(self, **values: Any) -> None:
        """Have the manifest say something else of every clip of one level."""
        with self.services.database.write() as session:
            version = session.query(StudyVersion).one()
            clips = [
                clip | (values if clip["levels"]["speed"] == "fast" else {})
                for clip in version.manifest["clips"]
            ]
            version.manifest = version.manifest | {"clips": clips}

    def rehearse(self, status: str, version: int = 1, message: str = "") -> None:
        """Put a rehearsal in the place of those before."""
        with self.services.database.write() as session:
            session.query(Job).delete()
            study = session.query(Study).one()
            parameters = {"version": version}
            session.add(
                Job(
                    study_id=study.id,
                    kind="rehearsal",
                    public_id="rehearsal",
                    status=status,
                    parameters=parameters,
                    message=message,
                )
            )

    def put_clip(self, content: bytes, **values: Any) -> None:
        """Store other bytes for the first clip, declared as they are."""
        sha256 = hashlib.sha256(content).hexdigest()
        self.services.clips.add(io.BytesIO(content), sha256)
        declare_clip(self.services, self.first_clip(), sha256=sha256, bytes=len(content), **values)

    def back_up(self, age_s: float) -> None:
        """Leave one backup of this age."""
        self.backups.mkdir(exist_ok=True)
        beginning, endings = NAMES
        path = self.backups / f"{beginning}test{endings[0] if isinstance(endings, tuple) else endings}"
        path.write_bytes(b"backup")
        written = time.time() - age_s
        os.utime(path, (written, written))

    def checks(self) -> list[Any]:
        """The checklist, as the page gets it."""
        return list(self.owner.get("/studies/short/launch-checks").json())


class Fault(NamedTuple):
    """One planted fault.

    Attributes
    ----------
    kind, words : str
        Of the line of the checklist that names it.
    declared : tuple of (str, str)
        Texts of the declaration, each with the one in its place.
    plant : callable, optional
        What else is done.
    blocks : bool
        Whether the study is refused.
    without : str
        A step before going live that is left out: seal, rehearsal or preview.
    """

    kind: str
    words: str
    declared: tuple[tuple[str, str], ...] = ()
    plant: Callable[[Ground], None] | None = None
    blocks: bool = False
    without: str = ""


def other_codec() -> bytes:
    """A clip of MPEG-4 Part 2."""
    written = io.BytesIO()
    with av.open(written, "w", format="mp4") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = 256, 96, "yuv420p"
        for number in range(4):
            frame = av.VideoFrame(256, 96, "yuv420p")
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return written.getvalue()


def lids_left_open(ground: Ground) -> None:
    with ground.services.database.write() as session:
        version = session.query(StudyVersion).one()
        ends = {"slow": 0.0, "fast": 0.1}
        clips = [
            clip | {"closure": [0.0, 1.0, ends[clip["levels"]["speed"]]]}
            for clip in version.manifest["clips"]
        ]
        version.manifest = version.manifest | {"clips": clips}


def no_links(ground: Ground) -> None:
    with ground.services.database.write() as session:
        session.query(Link).filter_by(kind="personal").delete()


def link_of_prolific(ground: Ground) -> None:
    ground.study.link("general", recruiter={"kind": "prolific"})


def no_backups(ground: Ground) -> None:
    for path in ground.backups.iterdir():
        path.unlink()


def unreadable_backups(ground: Ground) -> None:
    ground.set_settings(backup_folder="s3://there-is-none/backups", s3_endpoint="http://127.0.0.1:9")


PROLIFIC = {"kind": "prolific", "code_complete": "C1ABC"}
CONSENT_TIME = "Participation takes about 5 minutes."
NO_CHECKS = ("[attention]\nper_block = 1", "[attention]\nper_block = 0")
SMALL_WINDOWS = ("[trial]\n", '[display]\ncalibrate = "off"\nminimum_width_px = 1\n\n[trial]\n')
FAULTS: dict[str, Fault] = {
    # Texts that participants read.
    "a title to fill in": Fault(
        "placeholders", "[Title]", (("# Ratings of clips", "# [Title]"),), blocks=True
    ),
    "a doubtful mark": Fault("placeholders", "<name>", (("Ada Lovelace", "<name>"),)),
    "a mark in a question": Fault("placeholders", "TODO", (('"Age"', '"TODO"'),), blocks=True),
    "a mark in the second language": Fault(
        "placeholders",
        '"Consent" (language de)',
        (TWO_LANGUAGES, ("Dauer: 5 Minuten", "[Dauer]")),
        blocks=True,
    ),
    "a text without its translation": Fault("translations", '"Title" of the questionnaire', (TWO_LANGUAGES,)),
    # What the consent promises.
    "no contact": Fault("contact", "no e-mail address", (("Ada Lovelace, ada@example.org", "ask us"),)),
    "no time": Fault("time", "does not say how long", ((CONSENT_TIME, "It is short."),)),
    "far too long a time": Fault("time", "says 60 minutes", (("about 5 minutes", "60 minutes"),)),
    "low pay": Fault("pay", "£0.05 for about", (("£1.50", "£0.05"),)),
    "low pay per hour": Fault("pay", "£3.00 per hour", (("£1.50", "£3 per hour"),)),
    "pay that is not stated": Fault(
        "pay",
        "does not say what participants are paid",
        ((" You receive £1.50.", ""),),
        lambda ground: ground.recruit(**PROLIFIC),
    ),
    "flicker that is not mentioned": Fault(
        "flicker", "does not mention flicker", (("[trial]\n", checked("[trial]\n")),), without="preview"
    ),
    # Clips.
    "windows smaller than the clips": Fault("clip_size", "256 x 96", (SMALL_WINDOWS,)),
    "levels with open and closed lids": Fault("levels_told_apart", "'speed'", plant=lids_left_open),
    "levels of other lengths": Fault(
        "levels_told_apart",
        "number of frames",
        plant=lambda ground: ground.change_fast_clips(frames=5),
    ),
    "levels of other frame rates": Fault(
        "levels_told_apart", "frame rate", plant=lambda ground: ground.change_fast_clips(fps=25)
    ),
    "levels of other sizes": Fault(
        "levels_told_apart", "picture size", plant=lambda ground: ground.change_fast_clips(width_px=254)
    ),
    "a clip that is lost": Fault(
        "clip_missing",
        "1 clip is missing on the server",
        plant=lambda ground: lose_clip(ground.services, ground.first_clip()),
        blocks=True,
    ),
    "a clip with other bytes": Fault(
        "clip_different",
        "expected SHA-256",
        plant=lambda ground: flip_byte(ground.services, ground.first_clip()),
        blocks=True,
    ),
    "a clip with other frames": Fault(
        "clip_different",
        "expected 9 frames",
        plant=lambda ground: declare_frames(ground.services, ground.first_clip()),
        blocks=True,
    ),
    "a clip that is not a video": Fault(
        "clip_undecodable",
        "cannot be read as a video",
        plant=lambda ground: declare_other_bytes(ground.services, ground.first_clip()),
        blocks=True,
    ),
    "a clip of another rate": Fault(
        "clip_other_rate",
        "recorded at 15.0 frames per second",
        plant=lambda ground: ground.put_clip(encoded_video(4, 15)),
    ),
    "a clip of another codec": Fault(
        "clip_codec", "mpeg4", plant=lambda ground: ground.put_clip(other_codec())
    ),
    # Recruitment.
    "nobody knows who takes part": Fault("recruiter", "No recruiter is set", plant=no_links),
    "Prolific without its code": Fault(
        "completion_code",
        "needs the completion code",
        plant=lambda ground: ground.recruit(kind="prolific"),
        blocks=True,
    ),
    "a link of Prolific without its code": Fault(
        "completion_code",
        "Enter it under Links",
        plant=link_of_prolific,
        blocks=True,
    ),
    "SONA without its completion URL": Fault(
        "recruiter", "SONA grants credit", plant=lambda ground: ground.recruit(kind="sona")
    ),
    "people from outside without checks": Fault(
        "person_checks", "too few attention", (NO_CHECKS,), lambda ground: ground.recruit(**PROLIFIC)
    ),
    # How the study runs.
    "a pause": Fault("paused", "paused", plant=lambda ground: ground.study.change(paused=True)),
    "no limit": Fault("quota", "No limit is set", plant=lambda ground: ground.study.change(quota=None)),
    "a limit below the plan": Fault(
        "quota", "closes after 3 complete runs", plant=lambda ground: ground.study.change(quota=3)
    ),
    # The server.
    "a full disk": Fault(
        "disk",
        "GB free",
        plant=lambda ground: ground.monkeypatch.setattr("server.operations.doctor.LEAST_FREE_BYTES", 1 << 60),
    ),
    "no folder of backups": Fault(
        "backups", "not monitored", plant=lambda ground: ground.set_settings(backup_folder="")
    ),
    "no backup": Fault("backups", "there is none", plant=no_backups),
    "an old backup": Fault("backups", "72 h old", plant=lambda ground: ground.back_up(3 * DAY_S)),
    "backups that cannot be read": Fault("backups", "cannot be read", plant=unreadable_backups),
    "an address of this machine": Fault(
        "address",
        "opens only on this machine",
        plant=lambda ground: ground.set_settings(public_url="http://localhost:8000"),
    ),
    "an address without https": Fault(
        "address",
        "Put https in front",
        plant=lambda ground: ground.set_settings(public_url="http://studies.example.org"),
    ),
    # What is done before.
    "a plan that is not sealed": Fault("plan", "plan is not sealed", without="seal"),
    "a version that nobody tried": Fault("not_tried", "Nobody has completed version 1", without="preview"),
    "no rehearsal": Fault("rehearsal", "There is no rehearsal yet", without="rehearsal"),
    "a rehearsal that failed": Fault(
        "rehearsal",
        "failed: out of memory",
        plant=lambda ground: ground.rehearse("failed", message="out of memory"),
    ),
    "a rehearsal of another version": Fault(
        "rehearsal",
        "was of version 7, not of version 1",
        plant=lambda ground: ground.rehearse("done", version=7),
    ),
}
LEAST_FAULTS = 30
WAITS_S = 90.0


def made_ready(
    owner: Admin,
    client: TestClient,
    services: Services,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    fault: Fault,
) -> Ground:
    """A study with the declaration of a fault, and all that is done before it goes live but for one step."""
    text = GOOD
    for old, new in fault.declared:
        text = changed(text, old, new)
    study = add_study(services, folder / "clips", text, status="draft")
    ground = Ground(owner, client, services, study, folder / "backups", monkeypatch)
    study.change(quota=20)
    study.link("personal", label="P1")
    if fault.without != "seal":
        assert owner.send("POST", "/studies/short/seal", {}).status_code == 201
    if fault.without != "rehearsal":
        ground.rehearse("done")
    if fault.without != "preview":
        person = Participant(client, study.link("preview")).agree()
        person.answer_all()
        assert person.request("POST", "/complete").status_code == 200
    ground.back_up(60)
    ground.set_settings(public_url=ADDRESS, backup_folder=str(ground.backups))
    return ground


def test_nothing_speaks_against_a_study_without_a_planted_fault(
    owner: Admin, client: TestClient, services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = made_ready(owner, client, services, tmp_path, monkeypatch, Fault("", ""))
    assert ground.checks() == []
    assert opened(owner).status_code == 200
    assert ground.checks() == []  # its clips have been decoded
    assert len(FAULTS) >= LEAST_FAULTS


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_named_before_the_study_is_live(
    owner: Admin,
    client: TestClient,
    services: Services,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
) -> None:
    fault = FAULTS[name]
    ground = made_ready(owner, client, services, tmp_path, monkeypatch, fault)
    if fault.plant is not None:
        fault.plant(ground)
    ends = time.monotonic() + WAITS_S
    while not (found := named_by(fault, ground.checks())) and time.monotonic() < ends:
        time.sleep(0.1)  # clips are decoded in the background
    assert found, ground.checks()
    assert {one["blocks"] for one in found} == {fault.blocks}
    assert all(one["page"] != "build" or one["path"] for one in found)  # the way to where it is fixed
    assert owner.get("/studies/short").json()["summary"]["status"] == "draft"
    if fault.blocks:
        refused = opened(owner)
        assert refused.status_code == 409
        assert fault.words in refused.json()["error"]["message"]


def named_by(fault: Fault, checks: list[Any]) -> list[Any]:
    """The lines that name a fault."""
    return [one for one in checks if one["kind"] == fault.kind and fault.words in one["text"]]
