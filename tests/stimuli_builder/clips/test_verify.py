"""Checking a folder of clips."""

import json
import shutil
from pathlib import Path

import pytest

from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, file_sha256
from stimuli_builder.clips.geometry import PARTS, PREFIX
from stimuli_builder.clips.verify import verify

from .conftest import CURVE, Small, make_small


@pytest.fixture
def copied(built: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built, tmp_path / "clips"))


def rewrite(folder: Path, change: dict[str, object]) -> None:
    """Change the manifest's first clip, and its hash with it so that nothing else is noticed."""
    file = folder / MANIFEST_NAME
    manifest = json.loads(file.read_text())
    manifest["clips"][0] |= change
    manifest["clips"][0]["sha256"] = file_sha256(folder / manifest["clips"][0]["file"])
    file.write_text(json.dumps(manifest))


def test_what_was_built_passes_with_the_opening_measured(small: Small, built: Path) -> None:
    verdict = verify(built, small.folder)
    assert verdict.findings == ()
    assert (verdict.clips, verdict.opening_checked) == (8, 8)
    assert verdict.worst_opening_mm < 0.3


def test_a_character_that_is_not_here_leaves_the_opening_unmeasured(built: Path, tmp_path: Path) -> None:
    assert verify(built, tmp_path).opening_checked == 4


def test_a_missing_and_a_changed_clip_are_found(small: Small, copied: Path) -> None:
    clips = sorted(copied.glob("*.mp4"))
    clips[0].unlink()
    clips[1].write_bytes(clips[1].read_bytes() + b"more")
    found = verify(copied, small.folder).findings
    assert sorted(finding.problem.split(" ")[0] for finding in found) == ["its", "missing"]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"frames": 7}, "expected 7 frames"),
        ({"width_px": 322}, "expected 322 x 120 px"),
        ({"fps": 25.0}, "not spaced evenly at 25 fps"),
    ],
)
def test_wrong_numbers_are_found(small: Small, copied: Path, change: dict[str, object], problem: str) -> None:
    rewrite(copied, change)
    (finding,) = verify(copied, small.folder).findings[:1]
    assert problem in str(finding)


def test_a_declared_amount_that_is_not_a_number_is_a_finding(small: Small, copied: Path) -> None:
    clip = json.loads((copied / MANIFEST_NAME).read_text())["clips"][0]
    rewrite(copied, {"inputs": clip["inputs"] | {f"{PREFIX}{PARTS[0]}_mm": "a lot"}})
    verdict = verify(copied, small.folder)
    (finding,) = verdict.findings
    assert "cannot be read" in finding.problem
    assert "'a lot'" in finding.problem
    assert verdict.opening_checked == 7


def test_a_blink_one_frame_late_is_found_in_the_pixels(small: Small, copied: Path) -> None:
    closure = json.loads((copied / MANIFEST_NAME).read_text())["clips"][0]["closure"]
    rewrite(copied, {"closure": [closure[0]] * 10 + closure[:-10]})
    (finding,) = verify(copied, small.folder).findings
    assert "the opening of an eye differs from the curve by" in finding.problem


LIDS = """
[[factors]]
name = "eyes"
label = "Eyes"
[[factors.levels]]
name = "apart"
label = "Left and right as recorded"
render = { character = "cartoon", profile = "real", eyes = "separate" }
[[factors.levels]]
name = "lower"
label = "Lower lid moves"
render = { character = "tiny", profile = "lid.csv", lower_lid = "both" }
"""


@pytest.fixture(scope="module")
def lids(small_text: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Small, Path]:
    """A clip of eyes that move apart and one of a lower lid that moves, in this order."""
    head, rest = small_text.split("[[factors]]", 1)
    tail = (
        rest[rest.index("[exemplars]") :].replace("per_cell = 2", "per_cell = 1").replace('["profile"]', "[]")
    )
    folder = tmp_path_factory.mktemp("lids")
    (folder / "study").mkdir()
    samples = [f"{w},{0.9 * w},{0.8 * w}" for w in CURVE]
    table = "closure,lower_up_mm,lower_nasal_mm\n" + "\n".join(samples) + "\n"
    (folder / "study" / "lid.csv").write_text(table)
    study = make_small(folder / "study", head + LIDS + tail)
    study.build(folder / "clips")
    return study, folder / "clips"


@pytest.fixture
def lids_copied(lids: tuple[Small, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(lids[1], tmp_path / "clips"))


def test_eyes_apart_and_a_moving_lower_lid_are_measured(lids: tuple[Small, Path]) -> None:
    study, folder = lids
    verdict = verify(folder, study.folder)
    assert verdict.findings == ()
    assert (verdict.clips, verdict.opening_checked) == (2, 2)
    assert verdict.worst_opening_mm < 0.3


@pytest.mark.parametrize(
    ("number", "change", "problem"),
    [
        (0, {"closure_other": []}, "the opening of an eye"),
        (1, {"lower_vertical_mm": [], "lower_horizontal_mm": []}, "the opening of an eye"),
        (1, {"closure": [0.0] * 100}, "needs 100 finite samples"),
        (0, {"closure": [0.0] * 20, "closure_other": []}, "its curve is 2 frames long"),
        (0, {"closure": [2.0] * 200, "closure_other": []}, "closure must lie between 0 and 1"),
    ],
)
def test_curves_that_are_not_those_shown_are_found(
    lids: tuple[Small, Path], lids_copied: Path, number: int, change: dict[str, object], problem: str
) -> None:
    file = lids_copied / MANIFEST_NAME
    manifest = json.loads(file.read_text())
    manifest["clips"][number] |= change
    file.write_text(json.dumps(manifest))
    (finding,) = verify(lids_copied, lids[0].folder).findings
    assert problem in finding.problem


def test_a_file_that_is_not_a_video_is_found(small: Small, copied: Path) -> None:
    first = json.loads((copied / MANIFEST_NAME).read_text())["clips"][0]["file"]
    (copied / first).write_bytes(b"not a video at all")
    rewrite(copied, {})
    (finding,) = verify(copied, small.folder).findings
    assert "cannot be decoded" in finding.problem


def test_a_folder_without_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a manifest\.json"):
        verify(tmp_path)
