"""Somebody's own clips, and sets that were built elsewhere, become studies."""

import io
import json
import re
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

from experiments.load import parse_experiment
from server.context import Services
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT
from tests.helpers.tiny_clips import encoded_video, make_clip_folder
from tests.helpers.uploads import upload


def zipped(files: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def video_files(*names: str) -> dict[str, bytes]:
    # a trailing box that players skip makes each clip's bytes its own
    video = encoded_video(4, 30)
    return {name: video + (len(name) + 8).to_bytes(4, "big") + b"free" + name.encode() for name in names}


PATTERN = "{speed}_{mood}_{exemplar}.mp4"
OWN = ("fast_happy_1.mp4", "fast_happy_2.mp4", "fast_sad_1.mp4", "fast_sad_2.mp4",
       "slow_happy_1.mp4", "slow_happy_2.mp4", "slow_sad_1.mp4", "slow_sad_2.mp4")  # fmt: skip


def test_own_clips_become_a_study_by_a_file_name_pattern(experimenter: Admin) -> None:
    found = upload(experimenter, ("clips.zip", zipped(video_files(*OWN)))).json()
    assert len(found["files"]) == 8
    assert found["suggested_pattern"] == "{speed}_{emotion}_{exemplar}.mp4"
    body = {
        "name": "faces", "upload": found["id"], "levels": {"pattern": "{speed}_{mood}_{exemplar}.mp4"},
        "own_clips": {"title": "Faces", "question": "How friendly?", "low": "not at all", "high": "very"},
    }  # fmt: skip
    made = experimenter.send("POST", "/studies", body)
    assert made.status_code == 201, made.text
    design = made.json()["design"]
    assert (design["cells"], design["unique_clips"], design["trials_per_participant"]) == (4, 8, 8)
    assert made.json()["summary"]["status"] == "draft"


def test_the_smallest_window_holds_the_largest_clip(experimenter: Admin) -> None:
    films = {"fast_1.mp4": encoded_video(4, 30, 960, 360), "slow_1.mp4": encoded_video(4, 30, 320, 620)}
    found = upload(experimenter, ("clips.zip", zipped(films))).json()
    body = {
        "name": "wide", "upload": found["id"], "levels": {"pattern": "{speed}_{exemplar}.mp4"},
        "own_clips": {"title": "Wide"},
    }  # fmt: skip
    made = experimenter.send("POST", "/studies", body)
    assert made.status_code == 201, made.text
    stored = made.json()["toml"]
    display = parse_experiment(stored, "wide").display
    assert (display.minimum_width_px, display.minimum_height_px) == (960, 620)


def test_clips_are_listed_in_the_declared_order_of_their_levels(experimenter: Admin) -> None:
    names = [f"{speed}_{number}.mp4" for speed in ("fast", "middle", "slow") for number in (2, 1)]
    found = upload(experimenter, ("clips.zip", zipped(video_files(*names)))).json()
    levels = {"pattern": "{speed}_{exemplar}.mp4"}
    body = {"name": "speeds", "upload": found["id"], "levels": levels, "own_clips": {"title": "A"}}
    assert experimenter.send("POST", "/studies", body).status_code == 201
    factors = experimenter.get("/studies/speeds").json()["design"]["factors"]
    declared = [level["name"] for level in factors[0]["levels"]]
    clips = experimenter.get("/studies/speeds/clips").json()
    listed = [(clip["cell"], clip["exemplar"]) for clip in clips]
    assert listed == [(speed, number) for speed in declared for number in (1, 2)]
    assert declared == ["slow", "middle", "fast"]


OTHER_SCRIPTS = ["Ärm_x.mp4", "Örm_x.mp4", "腕, links_x.mp4"]


def test_names_in_any_script_stay_whole(experimenter: Admin) -> None:
    found = upload(experimenter, ("clips.zip", zipped(video_files(*OTHER_SCRIPTS)))).json()
    assert sorted(file["name"] for file in found["files"]) == OTHER_SCRIPTS
    levels = {"pattern": "{arm}_x.mp4"}
    body = {"name": "arms", "upload": found["id"], "levels": levels, "own_clips": {"title": "A"}}
    made = experimenter.send("POST", "/studies", body)
    assert made.status_code == 201, made.text
    clips = experimenter.get("/studies/arms/clips").json()
    assert {clip["file"] for clip in clips} == set(OTHER_SCRIPTS)


@pytest.mark.parametrize(
    "names",
    [("Arm_x.mp4", "arm_x.mp4"), (f"{chr(0xC4)}rm_x.mp4", f"A{chr(0x308)}rm_x.mp4")],
    ids=["case", "accent"],
)
def test_names_that_are_one_on_some_systems_are_refused(experimenter: Admin, names: tuple[str, str]) -> None:
    answer = upload(experimenter, ("clips.zip", zipped(video_files(*names))))
    assert answer.status_code == 422
    assert re.search("the same name on some systems|more than once", answer.json()["error"]["message"])


def test_one_name_twice_is_refused_also_without_a_zip(experimenter: Admin) -> None:
    files = [("files", ("a_x.mp4", b"1")), ("files", ("a_x.mp4", b"2"))]
    answer = experimenter.client.post("/api/admin/uploads", files=files)
    assert (answer.status_code, "more than once" in answer.json()["error"]["message"]) == (422, True)


def test_levels_that_are_numbers_are_in_their_order(experimenter: Admin) -> None:
    names = [f"{speed}_{n}.mp4" for speed in ("10", "2", "n1.5") for n in (1, 2)]
    table = "file,speed\n" + "\n".join(f"{name},{name.split('_')[0].replace('n', '-')}" for name in names)
    found = upload(experimenter, ("clips.zip", zipped(video_files(*names)))).json()
    body = {"name": "fast", "upload": found["id"], "levels": {"csv": table}, "own_clips": {"title": "A"}}
    made = experimenter.send("POST", "/studies", body).json()
    assert [level["name"] for level in made["design"]["factors"][0]["levels"]] == ["-1.5", "2", "10"]


def own_study(experimenter: Admin) -> dict[str, Any]:
    found = upload(experimenter, ("clips.zip", zipped(video_files(*OWN)))).json()
    body = {
        "name": "faces",
        "upload": found["id"],
        "levels": {"pattern": PATTERN},
        "own_clips": {"title": "F"},
    }
    made = experimenter.send("POST", "/studies", body)
    assert made.status_code == 201, made.text
    return dict(made.json())


def test_a_version_takes_further_clips_and_others_in_their_place(experimenter: Admin) -> None:
    made = own_study(experimenter)
    before = {clip["file"]: clip["clip_sha256"] for clip in experimenter.get("/studies/faces/clips").json()}
    others = {
        "calm_happy_1.mp4": 5,
        "calm_happy_2.mp4": 6,
        "calm_sad_1.mp4": 7,
        "calm_sad_2.mp4": 8,
        "fast_sad_1.mp4": 9,
    }
    files = {
        name: encoded_video(4, 30) + bytes([0, 0, 0, 9]) + b"free" + bytes([mark])
        for name, mark in others.items()
    }
    found = upload(experimenter, ("more.zip", zipped(files))).json()
    data = tomllib.loads(made["toml"])
    data["factors"][0]["levels"].append({"name": "calm", "label": "calm"})
    toml = experimenter.send("POST", "/definitions/edit", {"toml": made["toml"], "data": data}).json()["toml"]
    body = {"revision": made["summary"]["revision"], "toml": toml}
    refused = experimenter.send("POST", "/studies/faces/versions", body)
    assert "4 are missing from the manifest" in refused.json()["error"]["message"]
    clips = {"upload": found["id"], "levels": {"pattern": PATTERN}}
    undeclared = experimenter.send("POST", "/studies/faces/versions", body | clips | {"toml": made["toml"]})
    assert "which the definition does not declare" in undeclared.json()["error"]["message"]
    saved = experimenter.send("POST", "/studies/faces/versions", body | clips)
    assert saved.status_code == 201, saved.text
    after = {clip["file"]: clip["clip_sha256"] for clip in experimenter.get("/studies/faces/clips").json()}
    assert set(after) == set(OWN) | set(files)
    assert {name for name in before if before[name] != after[name]} == {"fast_sad_1.mp4"}
    assert [series["versions"] for series in saved.json()["series"]] == [[1], [2]]


def test_clips_change_cells_and_come_from_an_upload_into_cells(experimenter: Admin) -> None:
    made = own_study(experimenter)
    clips = {clip["file"]: clip for clip in experimenter.get("/studies/faces/clips").json()}

    def place(file: str, speed: str, face: str, exemplar: int, sha256: str = "") -> dict[str, Any]:
        levels = {"mood": face, "speed": speed}  # in another order than the factors are declared
        sha256 = sha256 or clips[file]["clip_sha256"]
        return {"clip_sha256": sha256, "file": file, "levels": levels, "exemplar": exemplar}

    stay = [
        place(clip["file"], clip["levels"]["speed"], clip["levels"]["mood"], clip["exemplar"])
        for clip in clips.values()
        if clip["cell"] != "fast/sad"
    ]
    swapped = [place("fast_sad_1.mp4", "fast", "sad", 2), place("fast_sad_2.mp4", "fast", "sad", 1)]
    body = {"toml": made["toml"], "places": stay + swapped}
    judged = experimenter.send("POST", "/studies/faces/versions/check", body).json()
    assert [change["text"] for change in judged["changes"]] == ["2 places in cells get other clips"]
    assert judged["series"] == 2
    renamed = {"toml": made["toml"].replace('"fast"', '"quick"'), "places": []}
    for clip in clips.values():
        speed = "quick" if clip["levels"]["speed"] == "fast" else clip["levels"]["speed"]
        renamed["places"].append(place(clip["file"], speed, clip["levels"]["mood"], clip["exemplar"]))
    check = "/studies/faces/versions/check"
    paths = [change["path"] for change in experimenter.send("POST", check, renamed).json()["changes"]]
    assert paths
    assert "clips" not in paths  # a level with another name keeps its clips
    fewer = experimenter.send("POST", check, {"toml": made["toml"], "places": stay}).json()
    assert [change["text"] for change in fewer["changes"]] == ["2 clips are removed"]
    body["revision"] = made["summary"]["revision"]
    saved = experimenter.send("POST", "/studies/faces/versions", body)
    assert saved.status_code == 201, saved.text
    after = {clip["file"]: clip["exemplar"] for clip in experimenter.get("/studies/faces/clips").json()}
    assert (after["fast_sad_1.mp4"], after["fast_sad_2.mp4"]) == (2, 1)

    body["revision"] += 1
    empty = experimenter.send("POST", "/studies/faces/versions", body | {"places": stay + swapped[:1]})
    assert "the first is fast/sad, exemplar 1" in empty.json()["error"]["message"]
    foreign = place("fast_sad_2.mp4", "fast", "sad", 1, "0" * 64)
    refused = experimenter.send("POST", "/studies/faces/versions", body | {"places": [*stay, foreign]})
    assert "neither a clip of this study nor of the upload" in refused.json()["error"]["message"]

    new = upload(
        experimenter, ("any name.mp4", video_files("any name.mp4")["any name.mp4"] + b"\0\0\0\x08free")
    )
    found = new.json()
    placed = place("any name.mp4", "fast", "sad", 1, found["files"][0]["sha256"])
    body |= {"places": [*stay, swapped[0], placed], "upload": found["id"]}
    saved = experimenter.send("POST", "/studies/faces/versions", body)
    assert saved.status_code == 201, saved.text
    files = {
        clip["cell"]: clip["file"]
        for clip in experimenter.get("/studies/faces/clips").json()
        if clip["exemplar"] == 1
    }
    assert files["fast/sad"] == "any name.mp4"


def test_a_level_that_is_taken_out_takes_its_clips_along(experimenter: Admin) -> None:
    made = own_study(experimenter)
    data = tomllib.loads(made["toml"])
    del data["factors"][0]["levels"][0]
    toml = experimenter.send("POST", "/definitions/edit", {"toml": made["toml"], "data": data}).json()["toml"]
    saved = experimenter.send(
        "POST", "/studies/faces/versions", {"revision": made["summary"]["revision"], "toml": toml}
    )
    assert saved.status_code == 201, saved.text
    assert len(experimenter.get("/studies/faces/clips").json()) == 4


def test_own_clips_become_a_study_by_a_table(experimenter: Admin) -> None:
    rows = ["file;speed;mood"] + [f"{name};{name.split('_')[0]};{name.split('_')[1]}" for name in OWN]
    found = upload(experimenter, ("clips.zip", zipped(video_files(*OWN)))).json()
    body = {
        "name": "faces",
        "upload": found["id"],
        "levels": {"csv": "\n".join(rows)},
        "own_clips": {"title": "Faces"},
    }
    made = experimenter.send("POST", "/studies", body)
    assert made.status_code == 201, made.text
    clips = experimenter.get("/studies/faces/clips").json()
    assert {(clip["levels"]["speed"], clip["exemplar"]) for clip in clips} == {
        ("fast", 1), ("fast", 2), ("slow", 1), ("slow", 2),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("csv", "message"),
    [
        ("speed,mood\nfast,happy", "a column 'file'"),
        ("file,speed\nfast_hapy_1.mp4,fast", "did you mean 'fast_happy_1.mp4'?"),
        ("file,speed\nfast_happy_1.mp4,fast\nfast_happy_1.mp4,fast", "expected each clip once"),
        ("file,speed\nfast_happy_1.mp4,", "has no level for 'speed'"),
        ("file,speed\nfast_happy_1.mp4,fast", "7 clips have no row"),
    ],
)
def test_a_wrong_table_is_refused_and_nothing_is_stored(experimenter: Admin, csv: str, message: str) -> None:
    found = upload(experimenter, ("clips.zip", zipped(video_files(*OWN)))).json()
    body = {"name": "faces", "upload": found["id"], "levels": {"csv": csv}, "own_clips": {"title": "Faces"}}
    answer = experimenter.send("POST", "/studies", body)
    assert answer.status_code == 422
    assert message in answer.json()["error"]["message"]
    assert experimenter.get("/studies").json() == []


def test_cells_must_have_equally_many_clips(experimenter: Admin) -> None:
    found = upload(experimenter, ("clips.zip", zipped(video_files(*OWN[:-1])))).json()
    body = {
        "name": "f",
        "upload": found["id"],
        "levels": {"pattern": "{speed}_{mood}_{exemplar}.mp4"},
        "own_clips": {"title": "F"},
    }
    assert (
        "expected the same number of clips in every cell"
        in experimenter.send("POST", "/studies", body).json()["error"]["message"]
    )


def spoilt(compression: int) -> bytes:
    """A zip whose only file cannot be unpacked from its first byte on."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        archive.writestr("a.mp4", bytes(range(256)))
    begin = 30 + len("a.mp4")  # of the data, behind the file's own header
    content = bytearray(stream.getvalue())
    content[begin : begin + 20] = b"\xff" * 20
    return bytes(content)


@pytest.mark.parametrize(
    ("name", "content", "status", "message"),
    [
        ("clips.zip", zipped({"../../evil.mp4": b"x"}), 422, "invalid path"),
        ("clips.zip", zipped({"/etc/evil.mp4": b"x"}), 422, "invalid path"),
        ("clips.zip", zipped({"run.sh": b"x"}), 422, "neither a video"),
        ("clips.zip", zipped({"a/one.mp4": b"x", "b/one.mp4": b"y"}), 422, "more than once"),
        ("clips.zip", zipped({"bomb.mp4": bytes(40_000_000)}), 422, "unpacks to far more"),
        ("clips.zip", b"PK not a zip", 422, "damaged"),
        ("clips.zip", spoilt(zipfile.ZIP_DEFLATED), 422, "damaged"),
        ("clips.zip", spoilt(zipfile.ZIP_LZMA), 422, "damaged"),
        ("../clip.mp4", b"x", 422, "invalid path"),
    ],
)  # fmt: skip
def test_unsafe_uploads_are_refused_whole(
    services: Services, experimenter: Admin, name: str, content: bytes, status: int, message: str
) -> None:
    answer = upload(experimenter, (name, content))
    assert (answer.status_code, message in answer.json()["error"]["message"]) == (status, True), answer.text
    assert list(services.settings.upload_folder.iterdir()) == []


def test_a_file_that_is_not_a_film_is_named(experimenter: Admin) -> None:
    found = upload(
        experimenter, ("clips.zip", zipped({"a_1.mp4": b"these are words", "b_1.mp4": encoded_video(4, 30)}))
    ).json()
    assert "cannot be read as a video" in found["files"][0]["problem"]
    body = {
        "name": "f",
        "upload": found["id"],
        "levels": {"pattern": "{x}_{exemplar}.mp4"},
        "own_clips": {"title": "F"},
    }
    assert (
        "'a_1.mp4' cannot be used" in experimenter.send("POST", "/studies", body).json()["error"]["message"]
    )


def test_a_built_set_is_uploaded_with_its_definition(experimenter: Admin, tmp_path: Path) -> None:
    make_clip_folder(parse_experiment(SHORT), tmp_path / "built")
    files = {path.name: path.read_bytes() for path in (tmp_path / "built").iterdir()}
    found = upload(experimenter, ("built.zip", zipped(files))).json()
    assert found["has_manifest"]
    made = experimenter.send("POST", "/studies", {"name": "built", "upload": found["id"], "toml": SHORT})
    assert made.status_code == 201, made.text
    assert "no clip says how large" not in str(made.json()["design"]["notes"])
    told = json.loads(files["manifest.json"]) | {"inter_ocular_px": None}
    told["clips"] = [clip | {"width_mm": None} for clip in told["clips"]]
    unsized = zipped(files | {"manifest.json": json.dumps(told).encode()})
    found = upload(experimenter, ("built.zip", unsized)).json()
    made = experimenter.send("POST", "/studies", {"name": "unsized", "upload": found["id"], "toml": SHORT})
    assert "no clip says how large it is to be shown" in str(made.json()["design"]["notes"])


def test_a_damaged_clip_of_a_built_set_is_named(experimenter: Admin, tmp_path: Path) -> None:
    make_clip_folder(parse_experiment(SHORT), tmp_path / "built")
    files = {path.name: path.read_bytes() for path in (tmp_path / "built").iterdir()}
    name = next(name for name in sorted(files) if name.endswith(".mp4"))
    found = upload(experimenter, ("built.zip", zipped(files | {name: files[name] + b"!"}))).json()
    answer = experimenter.send("POST", "/studies", {"name": "built", "upload": found["id"], "toml": SHORT})
    assert f"clip {name}: expected sha256" in answer.json()["error"]["message"]
    assert experimenter.get("/studies").json() == []
