import io

import pytest
from PIL import Image

from server.core.settings import Settings
from stimuli_builder.clips.preview import write_strips
from tests.helpers.admins import Admin


def test_the_shipped_blinks_are_served(viewer: Admin) -> None:
    library = viewer.get("/blinks/library").json()
    assert library["fps"] == 300
    assert len(library["profiles"]) >= 18
    for profile in library["profiles"]:
        assert max(profile["closure"]) <= 1.0
        assert profile["down_frames"] + profile["up_frames"] == len(profile["closure"]) - 1
    assert library["model"]["explained"]


def test_blinks_seen_in_both_eyes_carry_both_curves(viewer: Admin) -> None:
    profiles = viewer.get("/blinks/library").json()["profiles"]
    for profile in profiles:
        pair = profile["eye"] == "both"
        assert len(profile["closure_other"]) == (len(profile["closure"]) if pair else 0)
    assert {profile["eye"] for profile in profiles} >= {"left", "right", "both"}


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_strips_are_served_once_they_are_whole(viewer: Admin, settings: Settings) -> None:
    assert viewer.get("/blinks/strips").json()["characters"] == []
    assert "stimuli strips" in viewer.get("/blinks/strips/cartoon.webp").json()["error"]["message"]
    write_strips(settings.strips_folder, ["cartoon"])
    strips = viewer.get("/blinks/strips").json()
    assert (strips["characters"], len(strips["closures"])) == (["cartoon"], 33)
    answer = viewer.get("/blinks/strips/cartoon.webp")
    assert answer.headers["content-type"] == "image/webp"
    with Image.open(io.BytesIO(answer.content)) as picture:
        assert picture.size == (strips["width_px"], strips["height_px"] * 33)
    assert viewer.get("/blinks/strips/..%2Fsecret.webp").status_code == 404
    (settings.strips_folder / "cartoon.webp").unlink()
    assert viewer.get("/blinks/strips").json()["characters"] == []
