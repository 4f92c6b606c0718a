"""What is found before a study goes live."""

import hashlib
import io
import os
import shutil
import time
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.load import parse_experiment
from experiments.manifest import MANIFEST_NAME
from server.context import Services
from server.core.settings import Settings
from server.core.storage import FolderStore
from server.models import Study, StudyVersion
from server.operations.doctor import Finding
from server.rehearsals.service import of_finding
from server.studies import creation
from server.studies.cli import examined_clips
from server.studies.creation import store_clips
from server.transcoding.preparing import StoredClips
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study
from tests.helpers.thresholds import TWO_INTERVAL, text_with
from tests.helpers.tiny_clips import make_clip_folder
from tests.helpers.uploads import upload

CONSENT = '"Do you agree?"'
PLACEHOLDERS = '"# [Title]\\n\\nA study on [topic]. Responsible: [name]."'
PERSON = "5f3c2a1b4d6e7f8091a2b3c4"


def opened(admin: Admin, name: str = "short", status: str = "live") -> Any:
    revision = admin.get(f"/studies/{name}").json()["summary"]["revision"]
    return admin.send("PUT", f"/studies/{name}/status", {"revision": revision, "status": status})


def recruiting(admin: Admin, recruiter: dict[str, str] | None) -> Any:
    revision = admin.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "paused": False, "quota": None, "recruiter": recruiter}
    return admin.send("PUT", "/studies/short/settings", body)


def blocking(admin: Admin) -> list[str]:
    return [check["text"] for check in admin.get("/studies/short/launch-checks").json() if check["blocks"]]


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_text_with_unfilled_placeholders_does_not_go_live(
    owner: Admin, services: Services, tmp_path: Path, language: str
) -> None:
    first = CONSENT if language == "en" else '"Einverstanden?"'
    add_study(services, tmp_path / "clips", SHORT.replace(first, PLACEHOLDERS), status="draft")
    [text] = blocking(owner)
    assert text.startswith(f'The text "Consent" (language {language}) still has placeholders to fill in')
    assert "[Title], [topic], [name]" in text
    refused = opened(owner)
    assert refused.status_code == 409
    assert text in refused.json()["error"]["message"]
    assert opened(owner, status="pilot").status_code == 200
    assert opened(owner).status_code == 409
    assert owner.get("/studies/short").json()["summary"]["status"] == "pilot"


def test_no_later_version_of_a_live_study_brings_placeholders(owner: Admin, study: StudyInDatabase) -> None:
    revision = owner.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "toml": SHORT.replace(CONSENT, PLACEHOLDERS)}
    refused = owner.send("POST", "/studies/short/versions", body)
    assert refused.status_code == 409
    assert "[topic]" in refused.text
    assert owner.get("/studies/short").json()["summary"]["version"] == 1


def test_the_command_line_refuses_it_too(services: Services, settings: Settings, tmp_path: Path) -> None:
    add_study(services, tmp_path / "clips", SHORT.replace(CONSENT, PLACEHOLDERS), status="draft")
    refused = run_server_command(settings, "study", "status", "short", "live")
    assert "[topic]" in refused.stdout + refused.stderr
    with services.database.read() as session:
        assert session.query(Study).one().status == "draft"


def test_prolific_without_its_completion_code_does_not_go_live(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", status="draft")
    assert recruiting(owner, {"kind": "prolific"}).status_code == 200
    [text] = blocking(owner)
    assert "completion code" in text
    assert opened(owner).status_code == 409
    assert recruiting(owner, {"kind": "prolific", "code_complete": "C1ABC"}).status_code == 200
    assert blocking(owner) == []
    assert opened(owner).status_code == 200
    assert recruiting(owner, {"kind": "prolific"}).status_code == 409
    link = {"kind": "general", "recruiter": {"kind": "prolific"}}
    assert owner.send("POST", "/studies/short/links", link).status_code == 409


def test_a_recruiter_that_is_not_set_is_named_and_its_links_begin_no_visit(
    owner: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    kinds = [check["kind"] for check in owner.get("/studies/short/launch-checks").json()]
    assert "recruiter" in kinds
    for query in ({"PROLIFIC_PID": PERSON}, {"survey_code": "12"}, {"workerId": "A1B2C3D4E5"}):
        refused = Participant(client, study.link_token).start(query=query)
        assert refused.status_code == 409
        assert refused.json()["error"]["code"] == "recruiter_not_set"
    study.change(recruiter={"kind": "prolific", "code_complete": "C1ABC"})
    assert Participant(client, study.link_token).start(query={"PROLIFIC_PID": PERSON}).status_code == 201
    again = Participant(client, study.link_token).start(query={"PROLIFIC_PID": PERSON})
    assert again.status_code == 409
    kinds = [check["kind"] for check in owner.get("/studies/short/launch-checks").json()]
    assert "recruiter" not in kinds


def advice(admin: Admin, kind: str) -> list[str]:
    found = admin.get("/studies/short/launch-checks").json()
    return [check["text"] for check in found if check["kind"] == kind]


@pytest.mark.parametrize(
    ("attention", "advised"), [("per_block = 1", False), ("per_block = 0", True)], ids=["two", "none"]
)
def test_recruiting_for_a_study_without_enough_checks_recommends_them(
    owner: Admin, services: Services, tmp_path: Path, attention: str, advised: bool
) -> None:
    text = SHORT.replace("[attention]\nper_block = 1", f"[attention]\n{attention}")
    add_study(services, tmp_path / "clips", text, status="draft")
    assert advice(owner, "person_checks") == []
    assert recruiting(owner, {"kind": "prolific", "code_complete": "C1"}).status_code == 200
    assert bool(advice(owner, "person_checks")) == advised


def test_the_switch_for_online_recruitment_is_what_is_recommended(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    text = SHORT.replace("[attention]\nper_block = 1\n", "[evidence]\nonline_recruitment = true\n")
    text = text.replace(CONSENT, '"Some clips flicker. Do you agree?"')
    text = text.replace('"Einverstanden?"', '"Einige Clips flimmern. Einverstanden?"')
    add_study(services, tmp_path / "clips", text, status="draft")
    assert recruiting(owner, {"kind": "prolific", "code_complete": "C1"}).status_code == 200
    assert advice(owner, "person_checks") == advice(owner, "flicker") == []


FIT = (
    "# Ratings of clips\n\nParticipation takes about 5 minutes. You receive £1.50. "
    "Questions: Ada Lovelace, ada@example.org."
)
READY = SHORT.replace(CONSENT, f'"{FIT}"'.replace("\n", "\\n")).replace(
    '"Einverstanden?"', '"Dauer: 5 Minuten. Sie erhalten 1,50 €. Fragen: ada@example.org."'
)
READY = READY.replace('languages = ["en", "de"]', 'languages = ["en", "de"]\nparticipants = 20')


def changed(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


def test_a_completed_preview_is_a_trial_of_the_version(
    owner: Admin, client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", READY, status="draft")
    assert advice(owner, "not_tried")
    person = Participant(client, study.link("preview")).agree()
    person.answer_all()
    assert person.request("POST", "/complete").status_code == 200
    assert advice(owner, "not_tried") == []


def test_folders_of_the_server_are_not_shown() -> None:
    disk = Finding(
        "data folder", "failed", "/srv/secret, data: Permission denied", "set PALPEBRA_DATA_FOLDER"
    )
    backups = Finding("backups", "failed", "/srv/backups cannot be read: No such file", "look at the store")
    for kind, finding, said in (
        ("disk", disk, "Data folder: Permission denied. Set PALPEBRA_DATA_FOLDER."),
        ("backups", backups, "Backups: they cannot be read. Look at the store."),
    ):
        assert of_finding(kind, finding).text == said


# Clips that the server itself finds missing, changed or impossible to decode.


def lose_clip(services: Services, sha256: str) -> None:
    assert isinstance(services.clips, FolderStore)
    services.clips.path(sha256).unlink()


def flip_byte(services: Services, sha256: str) -> None:
    assert isinstance(services.clips, FolderStore)
    path = services.clips.path(sha256)
    path.chmod(0o600)
    path.write_bytes(path.read_bytes()[:-1] + b"!")


def declare_frames(services: Services, sha256: str) -> None:
    declare_clip(services, sha256, frames=9)


def declare_other_bytes(services: Services, sha256: str) -> None:
    """A file that is as its manifest says, but no video."""
    data = b"no video" * 64
    other = hashlib.sha256(data).hexdigest()
    services.clips.add(io.BytesIO(data), other)
    declare_clip(services, sha256, sha256=other, bytes=len(data))


def declare_clip(services: Services, clip: str, **values: Any) -> None:
    with services.database.write() as session:
        version = session.query(StudyVersion).one()
        clips = [one | (values if one["sha256"] == clip else {}) for one in version.manifest["clips"]]
        version.manifest = version.manifest | {"clips": clips}


CLIP_FAULTS = {
    lose_clip: ("clip_missing", "1 clip is missing on the server: "),
    flip_byte: ("clip_different", "expected SHA-256 "),
    declare_frames: ("clip_different", "expected 9 frames of 256 x 96 pixels, got 4 frames"),
    declare_other_bytes: ("clip_undecodable", "cannot be read as a video"),
}


@pytest.mark.parametrize("plant", CLIP_FAULTS, ids=lambda plant: plant.__name__)
def test_a_study_with_a_bad_clip_is_opened_only_anyway_and_the_audit_notes_it(
    owner: Admin, services: Services, settings: Settings, tmp_path: Path, plant: Any
) -> None:
    add_study(services, tmp_path / "clips", READY, status="draft")
    with services.database.read() as session:
        [clip, *_] = session.query(StudyVersion).one().manifest["clips"]
    plant(services, clip["sha256"])
    kind, said = CLIP_FAULTS[plant]
    refused = opened(owner)
    assert refused.status_code == 409, refused.text
    message = refused.json()["error"]["message"]
    assert said in message
    assert clip["file"] in message
    found = [one for one in owner.get("/studies/short/launch-checks").json() if one["kind"] == kind]
    assert [(one["text"], one["blocks"], one["page"]) for one in found] == [(message, True, "clips")]
    by_command = run_server_command(settings, "study", "status", "short", "live")
    assert by_command.returncode == 2
    assert message in by_command.stderr.replace("\n", " ")
    revision = owner.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "status": "live", "anyway": True}
    assert owner.send("PUT", "/studies/short/status", body).status_code == 200
    [entry] = [one for one in owner.get("/audit").json() if one["action"] == "status changed"]
    assert entry["details"] == {"before": "draft", "after": "live", "anyway": kind}


def test_the_command_opens_it_anyway_and_a_clip_brought_back_is_fine(
    owner: Admin, services: Services, settings: Settings, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", READY, status="draft")
    with services.database.read() as session:
        [clip, *_] = session.query(StudyVersion).one().manifest["clips"]
    assert isinstance(services.clips, FolderStore)
    data = services.clips.path(clip["sha256"]).read_bytes()
    lose_clip(services, clip["sha256"])
    assert opened(owner).status_code == 409
    services.clips.add(io.BytesIO(data), clip["sha256"])
    assert opened(owner).status_code == 200
    assert opened(owner, status="closed").status_code == 200
    lose_clip(services, clip["sha256"])
    assert run_server_command(settings, "study", "status", "short", "live").returncode == 2
    opened_anyway = run_server_command(settings, "study", "status", "short", "live", "--anyway")
    assert opened_anyway.returncode == 0, opened_anyway.stderr
    assert "1 clip is missing on the server" in opened_anyway.stdout.replace("\n", " ")
    [entry, *_] = [one for one in owner.get("/audit").json() if one["action"] == "status changed"]
    assert entry["details"]["anyway"] == "clip_missing"


@pytest.mark.parametrize(("rounds", "left"), [([70, 6, 0], 0), ([70, 70, 0], 70)], ids=["slow", "stuck"])
def test_a_command_waits_for_clips_as_long_as_more_of_them_are_examined(
    services: Services, monkeypatch: pytest.MonkeyPatch, rounds: list[int], left: int
) -> None:
    """A computer that needs more than a minute for the clips of a study can open it, too."""
    answers = iter(rounds)
    monkeypatch.setattr(services.stored_clips, "find_faults", lambda clips, within_s: ([], next(answers)))
    found = examined_clips(services, [object()] * 80)  # type: ignore[list-item]
    assert [one.text for one in found] == (
        [f"The server has not yet examined {left} clips. Try again in a minute."] if left else []
    )


def test_anyway_does_not_open_a_study_with_placeholders(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", SHORT.replace(CONSENT, PLACEHOLDERS), status="draft")
    body = {"revision": 1, "status": "live", "anyway": True}
    body["revision"] = owner.get("/studies/short").json()["summary"]["revision"]
    assert owner.send("PUT", "/studies/short/status", body).status_code == 409


def test_the_disk_is_examined_only_for_accounts_that_may_see_the_study(
    owner: Admin, services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_study(services, tmp_path / "clips", READY, status="draft")
    asked: list[Path] = []
    disk_usage = shutil.disk_usage

    def note_and_ask(folder: Path) -> Any:
        asked.append(folder)
        return disk_usage(folder)

    monkeypatch.setattr("shutil.disk_usage", note_and_ask)
    assert owner.get("/studies/nobodys/launch-checks").status_code == 404
    assert asked == []
    assert owner.get("/studies/short/launch-checks").status_code == 200
    assert asked


def test_a_new_version_of_a_live_study_is_decoded_before_it_is_live(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", READY, status="live")
    folder = tmp_path / "more"
    manifest = make_clip_folder(parse_experiment(READY), folder, frames=5)
    bad = manifest.clips[0]
    data = b"\0\0\0\x18ftypisom" + b"no video" * 64
    (folder / bad.file).write_bytes(data)
    replaced = bad.model_copy(update={"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)})
    written = manifest.model_copy(update={"clips": (replaced, *manifest.clips[1:])})
    (folder / MANIFEST_NAME).write_text(written.model_dump_json(), encoding="utf-8")
    sent = upload(owner, *((path.name, path.read_bytes()) for path in folder.iterdir())).json()
    revision = owner.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "toml": READY, "upload": sent["id"]}
    refused = owner.send("POST", "/studies/short/versions", body)
    assert refused.status_code == 409, refused.text
    assert "1 clip does not play in the participant page" in refused.json()["error"]["message"]
    assert owner.get("/studies/short").json()["summary"]["version"] == 1


def test_a_batch_of_clips_is_cut_at_the_end_of_its_time(services: Services, tmp_path: Path) -> None:
    wanted = READY.replace("per_cell = 2", "per_cell = 16")
    assert wanted != READY
    experiment = parse_experiment(wanted)
    folder = tmp_path / "clips"
    manifest = make_clip_folder(experiment, folder, frames=600, size_px=(640, 360))
    store_clips(services.clips, manifest, folder)
    assert len(manifest.clips) == 64
    stored = StoredClips(services.clips)
    began = time.monotonic()
    faults, left = stored.find_faults(manifest.clips, 1.0)
    assert time.monotonic() - began < 5
    assert faults == []  # a clip at which the time was over is not at fault
    assert left > 0


def test_a_clip_that_hangs_the_decoder_gets_the_fault_and_the_others_their_turn(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "clips"
    manifest = make_clip_folder(parse_experiment(READY), folder, frames=5)
    store_clips(services.clips, manifest, folder)
    pipe = tmp_path / "hangs.mp4"
    os.mkfifo(pipe)  # opening it waits until something is written
    path_of = StoredClips._path
    first = manifest.clips[0]
    monkeypatch.setattr(
        StoredClips, "_path", lambda self, clip, held: pipe if clip == first else path_of(self, clip, held)
    )
    monkeypatch.setattr("server.transcoding.preparing.HANGS_AFTER_S", 5.0)
    stored = StoredClips(services.clips)
    none = stored.find_faults(manifest.clips, 1.0)
    assert none == ([], len(manifest.clips))  # so little time is no proof
    faults, left = stored.find_faults(manifest.clips, 6.0)
    assert [(fault.file, fault.detail) for fault in faults] == [(first.file, "decoding it took too long")]
    assert left == len(manifest.clips) - 1
    faults, left = stored.find_faults(manifest.clips, 6.0)
    # The others come first; there was no time to try the one at fault again.
    assert ([fault.file for fault in faults], left) == ([first.file], 1)


def test_a_version_saved_while_the_study_is_set_live_is_refused(
    owner: Admin, services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its new clips were not decoded, as the study was a draft when that was decided."""
    add_study(services, tmp_path / "clips", READY, status="draft")
    planned = creation.planned_experiment

    def set_live_meanwhile(text: str) -> Any:
        with services.database.write() as session:
            session.query(Study).one().status = "live"
        return planned(text)

    body = {"revision": owner.get("/studies/short").json()["summary"]["revision"], "toml": READY}
    monkeypatch.setattr(creation, "planned_experiment", set_live_meanwhile)
    refused = owner.send("POST", "/studies/short/versions", body)
    assert (refused.status_code, refused.json()["error"]["code"]) == (409, "conflict")
    assert "was set live meanwhile" in refused.json()["error"]["message"]
    monkeypatch.setattr(creation, "planned_experiment", planned)
    assert owner.send("POST", "/studies/short/versions", body).status_code == 201


def test_a_standard_between_the_stimuli_is_named(owner: Admin, services: Services, tmp_path: Path) -> None:
    declared = text_with(SHORT, TWO_INTERVAL.replace('"100"', '"300"'))
    add_study(services, tmp_path / "clips", declared, status="draft")
    [check] = [
        one
        for one in owner.get("/studies/short/launch-checks").json()
        if one["path"] == "trial.task.standard"
    ]
    assert check["text"].startswith(
        "Expected a standard below all stimuli, got 300 with the stimuli 100, 200;"
    )
    assert (check["blocks"], check["page"]) == (False, "build")
