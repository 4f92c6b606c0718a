"""A file that was chosen by mistake is left out of an upload, and put back, before the study is made."""

from pathlib import Path
from typing import Any

import pytest

from server.context import Services
from tests.helpers.admins import Admin
from tests.helpers.uploads import looked_into, upload
from tests.helpers.videos import write_video

STUDY = {"levels": {"pattern": "{speed}_{exemplar}.mp4"}, "own_clips": {"title": "Own"}, "name": "own"}
STRAY = "Probe.mp4"
NAMES = ("schnell_1.mp4", "schnell_2.mp4", "träge_1.mp4", "träge_2.mp4", STRAY)


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, bytes]]:
    folder = tmp_path_factory.mktemp("videos")
    return [
        (name, write_video(folder / f"{index}.mp4", "libx264").read_bytes())
        for index, name in enumerate(NAMES)
    ]


def leave(admin: Admin, identifier: str, name: str, left_out: bool = True) -> Any:
    return admin.send("PUT", f"/uploads/{identifier}/left-out", {"file": name, "left_out": left_out})


def names_of(admin: Admin, identifier: str) -> list[str]:
    return [file["name"] for file in looked_into(admin, identifier).json()["files"]]


def test_a_study_is_made_without_the_file_that_was_left_out(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    received = upload(experimenter, *videos).json()
    assert received["suggested_pattern"] is None
    order = STUDY | {"upload": received["id"]}
    assert experimenter.send("POST", "/studies", order).status_code == 422
    told = leave(experimenter, received["id"], STRAY)
    assert told.json() == {"files": 4, "waiting": 0, "refused": 0, "left_out": 1}
    now = looked_into(experimenter, received["id"]).json()
    assert now["left_out"] == [STRAY]
    assert now["suggested_pattern"] == "{factor1}_{exemplar}.mp4"
    assert experimenter.send("POST", "/studies", order).status_code == 201
    assert len(experimenter.get("/studies/own/clips").json()) == 4


def test_a_file_put_back_is_as_it_was_and_not_looked_into_again(
    experimenter: Admin, videos: list[tuple[str, bytes]]
) -> None:
    before = upload(experimenter, *videos).json()
    for _ in range(2):  # asked twice it is the same
        assert leave(experimenter, before["id"], "träge_2.mp4").status_code == 200
    for _ in range(2):
        told = leave(experimenter, before["id"], "träge_2.mp4", left_out=False)
        assert told.json() == {"files": 5, "waiting": 0, "refused": 0, "left_out": 0}
    assert experimenter.get(f"/uploads/{before['id']}").json() == before


def test_another_file_of_its_name_is_looked_into_and_keeps_it_from_coming_back(
    experimenter: Admin, videos: list[tuple[str, bytes]], tmp_path: Path
) -> None:
    received = upload(experimenter, *videos).json()
    leave(experimenter, received["id"], "träge_1.mp4")
    other = write_video(tmp_path / "other.mp4", "libx264", size_px=(320, 120)).read_bytes()
    address = f"/api/admin/uploads/{received['id']}/files"
    experimenter.client.post(address, files={"files": ("träge_1.mp4", other)})
    now = looked_into(experimenter, received["id"]).json()
    assert [file["width_px"] for file in now["files"] if file["name"] == "träge_1.mp4"] == [320]
    refused = leave(experimenter, received["id"], "träge_1.mp4", left_out=False)
    assert refused.status_code == 422
    assert "was uploaded since" in refused.json()["error"]["message"]
    assert names_of(experimenter, received["id"]).count("träge_1.mp4") == 1


@pytest.mark.parametrize("left_out", [True, False])
@pytest.mark.parametrize("name", ["none.mp4", "../.account", ".account", ".prepared", "a/../schnell_1.mp4"])
def test_only_names_of_the_upload_s_videos_are_known(
    services: Services, experimenter: Admin, videos: list[tuple[str, bytes]], name: str, left_out: bool
) -> None:
    received = upload(experimenter, *videos[:2]).json()
    assert leave(experimenter, received["id"], name, left_out).status_code == 404
    folder = services.settings.upload_folder / received["id"]
    assert (folder / ".account").is_file()
    assert names_of(experimenter, received["id"]) == ["schnell_1.mp4", "schnell_2.mp4"]


def test_what_is_left_out_still_counts_against_the_room_of_an_upload(
    experimenter: Admin, videos: list[tuple[str, bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    received = upload(experimenter, *videos).json()
    for name, _ in videos:
        leave(experimenter, received["id"], name)
    monkeypatch.setattr("server.studies.uploads.MAX_KEPT_BYTES", 10)
    more = {"files": ("schnell_3.mp4", videos[0][1])}
    assert (
        experimenter.client.post(f"/api/admin/uploads/{received['id']}/files", files=more).status_code == 413
    )
