"""Checking a folder of clips."""

import json
import shutil
from pathlib import Path

import pytest

from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, file_sha256
from stimuli_builder.clips.verify import verify

from .conftest import Small


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


def test_a_blink_one_frame_late_is_found_in_the_pixels(small: Small, copied: Path) -> None:
    closure = json.loads((copied / MANIFEST_NAME).read_text())["clips"][0]["closure"]
    rewrite(copied, {"closure": [closure[0]] * 10 + closure[:-10]})
    (finding,) = verify(copied, small.folder).findings
    assert "mm more or less than the curve says" in finding.problem


def test_a_file_that_is_no_video_is_found(small: Small, copied: Path) -> None:
    first = json.loads((copied / MANIFEST_NAME).read_text())["clips"][0]["file"]
    (copied / first).write_bytes(b"not a video at all")
    rewrite(copied, {})
    (finding,) = verify(copied, small.folder).findings
    assert "cannot be decoded" in finding.problem


def test_a_folder_without_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a manifest\.json"):
        verify(tmp_path)
