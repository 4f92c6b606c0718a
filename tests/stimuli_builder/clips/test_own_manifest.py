"""`stimuli manifest`: clips of one's own become a set that a server takes."""

from pathlib import Path

import pytest

from experiments.load import load_experiment
from experiments.manifest import check_files, read_manifest
from stimuli_builder.cli import main
from tests.helpers.tiny_clips import encoded_video

STUDY = """
name = "robots"
title = "Robots"
[[factors]]
name = "speed"
label = "Speed"
levels = [{ name = "10", label = "10" }, { name = "2", label = "2" }]
[exemplars]
per_cell = 2
[trial.scale]
question = { en = "How alive?" }
low = { en = "not" }
high = { en = "very" }
[texts.en]
consent = "c"
instructions = "i"
debrief = "d"
"""


STUDY_FILE = "robots.toml"


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    """Four clips of two speeds, with names beyond ASCII."""
    folder = tmp_path / "clips"
    folder.mkdir()
    for number, name in enumerate(("10_ä_1.mp4", "10_ä_2.mp4", "2_ä_1.mp4", "2_ä_2.mp4")):
        (folder / name).write_bytes(encoded_video(4, 30) + bytes([0, 0, 0, 9]) + b"free" + bytes([number]))
    (tmp_path / "robots.toml").write_text(STUDY, encoding="utf-8")
    return folder


def stimuli(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["stimuli", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    return int(stopped.value.code or 0)


def test_a_manifest_is_written_by_the_names(monkeypatch: pytest.MonkeyPatch, clips: Path) -> None:
    study = clips.parent / "robots.toml"
    wanted = ("manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4", "--experiment", study)
    assert stimuli(monkeypatch, *wanted) == 0
    manifest = read_manifest(clips)
    check_files(manifest, clips)
    assert [(clip.cell, clip.exemplar, clip.frames, clip.fps) for clip in manifest.clips] == [
        ("10", 1, 4, 30.0), ("10", 2, 4, 30.0), ("2", 1, 4, 30.0), ("2", 2, 4, 30.0),
    ]  # fmt: skip
    assert manifest.experiment == load_experiment(str(study)).name


def test_without_a_declaration_the_folder_names_the_set(monkeypatch: pytest.MonkeyPatch, clips: Path) -> None:
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}_{style}_{exemplar}.mp4") == 0
    assert read_manifest(clips).experiment == "clips"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--pattern", "{speed}-{exemplar}.mp4"), "does not follow the pattern"),
        ((), "expected either --pattern or --table"),
        (("--table", "none.csv"), "no file none.csv"),
        (
            ("--pattern", "{pace}_ä_{exemplar}.mp4", "--experiment", STUDY_FILE),
            "expected those of robots: speed",
        ),
    ],
)
def test_what_does_not_fit_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path,
    arguments: tuple[str, ...], message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(clips.parent)
    code = stimuli(monkeypatch, "manifest", clips, *arguments)
    printed = capsys.readouterr().err
    assert code != 0
    assert message in printed
    assert not (clips / "manifest.json").exists()


def test_levels_that_cannot_be_rendered_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    out = clips.parent / "out"
    assert stimuli(monkeypatch, "build", clips.parent / "robots.toml", "--out", out) != 0
    assert "'10' and '2' change nothing of the rendering" in capsys.readouterr().err
    assert not out.exists()
