"""Own videos of any format on their way to a study: examined outside the server, kept, reported."""

import hashlib
import time
from pathlib import Path
from typing import Any

import pytest

from server.context import Services
from server.core.locks import FileLocks
from server.transcoding.preparing import UploadPreparation
from server.transcoding.records import BEGUN, records_of
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, clip_url
from tests.helpers.uploads import looked_into, upload
from tests.helpers.videos import FRAMES, write_sound, write_video

NAMES = {"slow_1.webm": "libvpx-vp9", "slow_2.mp4": "libx264", "fast_1.mkv": "ffv1", "fast_2.avi": "mpeg4"}
STUDY = {"levels": {"pattern": "{speed}_{exemplar}.mp4"}, "own_clips": {"title": "Own"}}


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, bytes]]:
    folder = tmp_path_factory.mktemp("videos")
    return [(name, write_video(folder / name, codec).read_bytes()) for name, codec in NAMES.items()]


def made_study(experimenter: Admin, videos: list[tuple[str, bytes]]) -> dict[str, Any]:
    received = upload(experimenter, *videos).json()
    made = experimenter.send("POST", "/studies", STUDY | {"name": "own", "upload": received["id"]})
    assert made.status_code == 201, made.text
    return received


def test_videos_of_any_format_become_a_study(
    services: Services, experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    received = made_study(experimenter, videos)
    assert received["suggested_pattern"] == "{speed}_{exemplar}.mp4"
    sources = {file["name"]: file["source"] for file in received["files"]}
    assert sources["slow_2.mp4"] is None
    assert sources["slow_1.webm"]["changes"] == ["encoded as H.264, was vp9"]
    assert sources["slow_1.webm"]["lowest_psnr_db"] > 35
    clips = {clip["file"]: clip for clip in experimenter.get("/studies/own/clips").json()}
    assert set(clips) == {"slow_1.mp4", "slow_2.mp4", "fast_1.mp4", "fast_2.mp4"}
    for clip in clips.values():
        assert clip["frames"] == FRAMES
        assert services.clips.size(clip["clip_sha256"]) == clip["bytes"]
    assert clips["slow_1.mp4"]["source"]["colour_range"] == "limited"


def test_the_original_is_kept_with_its_name_and_its_frame_map(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    made_study(experimenter, videos)
    source = next(clip["source"] for clip in experimenter.get("/studies/own/clips").json() if clip["source"])
    original = experimenter.get(f"/studies/own/originals/{source['sha256']}")
    assert original.content == dict(videos)[source["file"]]
    assert source["file"] in original.headers["content-disposition"]
    table = experimenter.get(f"/studies/own/originals/{source['sha256']}/frame-map.csv").text.splitlines()
    assert table[:3] == ["frame,original_frame", "0,0", "1,1"]
    assert len(table) == FRAMES + 1
    assert experimenter.get(f"/studies/own/originals/{'0' * 64}").status_code == 404


def test_a_participant_is_sent_the_converted_clip(
    client: Any, experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    made_study(experimenter, videos)
    link = experimenter.send("POST", "/studies/own/links", {"kind": "preview", "labels": [], "count": 1})
    person = Participant(client, link.json()[0]["url"].rsplit("/", 1)[1]).agree()
    addresses = {clip_url(trial) for trial in person.state()["trials"]}
    assert len(addresses) == 4
    for address in addresses:
        answer = client.get(address)
        assert (answer.status_code, answer.content[4:8]) == (200, b"ftyp")


def test_a_clip_of_an_upload_can_be_tried_by_its_sender_alone(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    received = upload(experimenter, *videos).json()
    files = {file["name"]: file for file in received["files"]}
    address = f"/uploads/{received['id']}/clips/"
    assert experimenter.get(address + files["slow_2.mp4"]["sha256"]).content == dict(videos)["slow_2.mp4"]
    converted = experimenter.get(address + files["slow_1.webm"]["sha256"])
    assert (converted.content[4:8], len(converted.content) > 0) == (b"ftyp", True)
    assert hashlib.sha256(converted.content).hexdigest() == files["slow_1.webm"]["sha256"]
    assert converted.headers["content-type"] == "application/octet-stream"
    assert experimenter.get(address + "0" * 64).status_code == 404
    assert experimenter.get(address + "..%2F.account").status_code == 404
    assert experimenter.get(f"/uploads/{'0' * 32}/clips/{files['slow_2.mp4']['sha256']}").status_code == 404


def test_what_cannot_be_a_clip_is_named_and_keeps_the_study_from_being_made(
    experimenter: Admin, tmp_path: Path, videos: list[tuple[str, bytes]]
) -> None:
    sound = ("slow_2.mp4", write_sound(tmp_path / "a.mp4").read_bytes())
    received = upload(experimenter, *(file for file in videos if file[0] != sound[0]), sound).json()
    problems = {file["name"]: file["problem"] for file in received["files"] if file["state"] == "refused"}
    assert list(problems) == ["slow_2.mp4"]
    made = experimenter.send("POST", "/studies", STUDY | {"name": "own", "upload": received["id"]})
    assert (made.status_code, "'slow_2.mp4' cannot be used: it holds audio" in made.text) == (422, True)


def test_one_refused_file_is_replaced_and_the_others_stay(
    experimenter: Admin, tmp_path: Path, videos: list[tuple[str, bytes]]
) -> None:
    good = dict(videos)
    sound = ("slow_2.mkv", write_sound(tmp_path / "a.mp4").read_bytes())
    received = upload(experimenter, *(file for file in videos if file[0] != "slow_2.mp4"), sound).json()
    address = f"/api/admin/uploads/{received['id']}/files"

    def put(old: str, name: str, content: bytes) -> Any:
        return experimenter.client.post(address, files={"files": (name, content)}, data={"replaces": old})

    assert put("none.mp4", "slow_2.mp4", b"").status_code == 404
    assert put("n" * 400, "slow_2.mp4", b"").status_code == 404
    assert put("../../a.mp4", "slow_2.mp4", b"").status_code == 404
    taken = put("slow_2.mkv", "fast_1.mkv", good["fast_1.mkv"])
    assert (taken.status_code, "was already uploaded" in taken.text) == (422, True)
    twin = put("slow_2.mkv", "Fast_1.mp4", good["fast_1.mkv"])
    assert (twin.status_code, "the same name on some systems" in twin.text) == (422, True)
    unlike = put("slow_2.mkv", "slow_2.zip", b"PK")
    assert (unlike.status_code, "neither a video" in unlike.text) == (422, True)
    assert experimenter.get(f"/uploads/{received['id']}").json()["files"] == received["files"]

    told = put("slow_2.mkv", "slow_2.mp4", good["slow_2.mp4"])
    assert told.status_code == 200, told.text
    after = {file["name"]: file for file in looked_into(experimenter, received["id"]).json()["files"]}
    assert set(after) == set(NAMES)
    assert {file["state"] for file in after.values()} == {"ready"}
    kept = {file["name"]: file for file in received["files"] if file["state"] == "ready"}
    assert {name: after[name] for name in kept} == kept
    made = experimenter.send("POST", "/studies", STUDY | {"name": "own", "upload": received["id"]})
    assert made.status_code == 201, made.text


def test_a_file_replaced_under_its_own_name_is_looked_into_again(
    experimenter: Admin, tmp_path: Path, videos: list[tuple[str, bytes]]
) -> None:
    sound = ("slow_2.mp4", write_sound(tmp_path / "a.mp4").read_bytes())
    received = upload(experimenter, sound).json()
    address = f"/api/admin/uploads/{received['id']}/files"
    good = {"files": ("slow_2.mp4", dict(videos)["slow_2.mp4"])}
    experimenter.client.post(address, files=good, data={"replaces": "slow_2.mp4"})
    after = looked_into(experimenter, received["id"]).json()["files"]
    assert [(file["name"], file["state"]) for file in after] == [("slow_2.mp4", "ready")]


def test_two_files_that_would_be_one_clip_are_refused(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    answer = upload(experimenter, ("a_1.webm", videos[0][1]), ("a_1.mp4", videos[1][1]))
    assert (answer.status_code, "the same name on some systems" in answer.text) == (422, True)


def test_the_same_bytes_under_two_names_are_remarked(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    received = upload(experimenter, ("a_1.mp4", videos[1][1]), ("b_1.mp4", videos[1][1])).json()
    assert [file["same_as"] for file in received["files"]] == [None, "a_1.mp4"]


def test_one_frame_rate_for_all_clips(experimenter: Admin, videos: list[tuple[str, bytes]]) -> None:
    received = upload(experimenter, *videos, fps=50).json()
    assert {(file["fps"], file["frames"]) for file in received["files"]} == {(50, 2 * FRAMES)}
    experimenter.send("PUT", f"/uploads/{received['id']}/frame-rate", {"fps": None})
    again = looked_into(experimenter, received["id"]).json()
    assert {(file["fps"], file["frames"]) for file in again["files"]} == {(25, FRAMES)}


def test_an_upload_goes_on_where_it_was_broken_off(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    begun = experimenter.client.post("/api/admin/uploads").json()
    assert (begun["files"], begun["waiting"]) == ([], 0)
    address = f"/api/admin/uploads/{begun['id']}/files"
    for part in (videos[:2], videos[1:]):  # the second is sent twice: its receipt was lost
        answer = experimenter.client.post(address, files=[("files", file) for file in part])
        assert answer.status_code == 200, answer.text
    whole = looked_into(experimenter, begun["id"]).json()
    assert [file["name"] for file in whole["files"]] == sorted(NAMES)
    other = experimenter.client.post(address, files=[("files", (videos[0][0], b"something else"))])
    assert (other.status_code, "more than once" in other.text) == (422, True)


def wait_for_end(preparing: UploadPreparation) -> None:
    until = time.monotonic() + 60
    while preparing._thread is not None:
        assert time.monotonic() < until
        time.sleep(0.02)


def test_a_file_at_which_the_worker_ended_twice_is_refused_and_the_others_are_prepared(
    tmp_path: Path, videos: list[tuple[str, bytes]]
) -> None:
    folder = tmp_path / "uploads" / "a"
    folder.mkdir(parents=True)
    for name, content in videos:
        (folder / name).write_bytes(content)
    (folder / BEGUN).write_text("slow_2.mp4\nslow_2.mp4\n")
    preparing = UploadPreparation(folder.parent, FileLocks(folder.parent.parent / "locks"))
    preparing.begin()
    wait_for_end(preparing)
    records = records_of(folder)
    assert {name: record.problem is None for name, record in records.items()} == {
        "fast_1.mkv": True, "fast_2.avi": True, "slow_1.webm": True, "slow_2.mp4": False,
    }  # fmt: skip
    assert "stopped the decoder" in (records["slow_2.mp4"].problem or "")


@pytest.mark.parametrize("error", [FileNotFoundError("removed meanwhile"), RuntimeError("unforeseen")])
def test_an_error_on_the_way_stops_no_later_upload(
    tmp_path: Path, videos: list[tuple[str, bytes]], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    folder = tmp_path / "uploads" / "a"
    folder.mkdir(parents=True)
    (folder / "slow_2.mp4").write_bytes(dict(videos)["slow_2.mp4"])
    preparing = UploadPreparation(folder.parent, FileLocks(folder.parent.parent / "locks"))

    def refuses(_: Path) -> list[Path]:
        raise error

    with monkeypatch.context() as broken:
        broken.setattr("server.transcoding.preparing.waiting_in", refuses)
        broken.setattr(preparing, "_work", lambda: None)
        preparing.begin()
        wait_for_end(preparing)
    assert records_of(folder) == {}
    preparing.begin()
    wait_for_end(preparing)
    assert list(records_of(folder)) == ["slow_2.mp4"]


def test_what_a_server_left_is_done_by_the_next(tmp_path: Path, videos: list[tuple[str, bytes]]) -> None:
    folder = tmp_path / "uploads" / "a"
    folder.mkdir(parents=True)
    (folder / "slow_2.mp4").write_bytes(dict(videos)["slow_2.mp4"])
    first = UploadPreparation(folder.parent, FileLocks(folder.parent.parent / "locks"))
    first.close()
    first.begin()
    assert records_of(folder) == {}
    second = UploadPreparation(folder.parent, FileLocks(folder.parent.parent / "locks"))
    second.begin()
    wait_for_end(second)
    assert list(records_of(folder)) == ["slow_2.mp4"]
