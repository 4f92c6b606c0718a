import json
from pathlib import Path

import pytest

from experiments.errors import InputError
from experiments.manifest import Clip, Manifest, check_files, file_sha256, read_manifest


def write_folder(folder: Path) -> Manifest:
    (folder / "clip.mp4").write_bytes(b"not really a film")
    clip = Clip(
        levels={"speed": "fast"}, cell="fast", exemplar=1, file="clip.mp4",
        sha256=file_sha256(folder / "clip.mp4"), bytes=17, fps=30, frames=45, width_px=960, height_px=360,
    )  # fmt: skip
    manifest = Manifest(
        experiment="mine", definition_sha256="0" * 64, program_version="0", seed=1, clips=(clip,)
    )
    (folder / "manifest.json").write_text(manifest.model_dump_json())
    return manifest


def test_a_manifest_reads_back_as_it_was_written(tmp_path: Path) -> None:
    manifest = write_folder(tmp_path)
    assert read_manifest(tmp_path) == manifest
    check_files(manifest, tmp_path)


def test_a_missing_clip_is_named(tmp_path: Path) -> None:
    manifest = write_folder(tmp_path)
    (tmp_path / "clip.mp4").unlink()
    with pytest.raises(InputError, match=r"clip clip\.mp4 \(fast, exemplar 1\) is missing"):
        check_files(manifest, tmp_path)


def test_a_changed_clip_is_named(tmp_path: Path) -> None:
    manifest = write_folder(tmp_path)
    (tmp_path / "clip.mp4").write_bytes(b"another film here")
    with pytest.raises(InputError, match=r"expected sha256 .* got .* build the clips again"):
        check_files(manifest, tmp_path)


def test_a_folder_without_a_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a manifest\.json"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("file", ["../clip.mp4", "a/b.mp4", ".hidden", ""])
def test_a_clip_outside_the_folder_is_refused(tmp_path: Path, file: str) -> None:
    data = json.loads(write_folder(tmp_path).model_dump_json())
    data["clips"][0]["file"] = file
    (tmp_path / "manifest.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"clips\.0\.file"):
        read_manifest(tmp_path)
