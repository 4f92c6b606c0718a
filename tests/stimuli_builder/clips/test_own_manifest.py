"""`stimuli manifest`: your own clips become a set that a server takes."""

from pathlib import Path
from typing import Any

import pytest

from experiments.errors import InputError
from experiments.load import load_experiment, parse_experiment
from experiments.manifest import check_files, check_originals, file_sha256, read_manifest
from server.core.storage import FolderStore
from server.studies.creation import store_clips
from stimuli_builder.cli import main
from stimuli_builder.clips.design_clips import check_levels
from tests.conftest import REPOSITORY
from tests.helpers.tiny_clips import encoded_video
from tests.helpers.videos import HEIGHT, WIDTH, write_sound, write_video
from video_conversion.video_file import examine

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
ODD: dict[str, dict[str, Any]] = {
    ".webm": {"codec": "libvpx-vp9"},
    ".mov": {"rotation_deg": 90},
    ".mp4": {"sound": True},
}


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
    (clips / manifest.clips[0].file).unlink()
    with pytest.raises(InputError, match="restore the file, or write the manifest again with `stimuli man"):
        check_files(manifest, clips)


def test_without_a_declaration_the_folder_names_the_set(monkeypatch: pytest.MonkeyPatch, clips: Path) -> None:
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}_{style}_{exemplar}.mp4") == 0
    assert read_manifest(clips).experiment == "clips"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--pattern", "{speed}-{exemplar}.mp4"), "does not match the pattern"),
        ((), "the levels of each clip are unknown: add either --pattern or --table"),
        (("--table", "none.csv"), "no file none.csv"),
        (
            ("--pattern", "{pace}_ä_{exemplar}.mp4", "--experiment", STUDY_FILE),
            "factor 'pace' of the clips is not declared in robots; expected one of: speed",
        ),
        (
            ("--pattern", "{spede}_ä_{exemplar}.mp4", "--experiment", STUDY_FILE),
            "factor 'spede' of the clips is not declared in robots; did you mean 'speed'?",
        ),
        (
            ("--pattern", "{speed}_{style}_{exemplar}.mp4", "--experiment", STUDY_FILE),
            "factor 'style' of the clips is not declared in robots, which has speed; declare it, or remove",
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


def empty_videos(folder: Path, *names: str) -> Path:
    folder.mkdir()
    for name in names:
        (folder / name).touch()
    return folder


def test_a_stray_level_is_named_next_to_what_was_understood(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    names = [f"{speed}_{number}.mp4" for speed in ("slow", "fast") for number in (1, 2, 3, 4)]
    names[3] = "slwo_4.mp4"
    folder = empty_videos(tmp_path / "clips", *names)
    assert stimuli(monkeypatch, "manifest", folder, "--pattern", "{speed}_{exemplar}.mp4") != 0
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "levels of speed, with their clips: fast (4), slow (3), slwo (1)",
        "'slwo' of speed (slwo_4.mp4) looks like 'slow': correct the name if 'slow' is intended",
    ]
    assert "expected the same number of clips in every cell: fast has 4, slwo has 1" in told.err


def test_a_forgotten_exemplar_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    for name in ("10_ä_1", "10_ä_2", "2_ä_1", "2_ä_2"):
        (clips / f"{name}.mp4").rename(clips / f"{name.replace('10', 'fast').replace('2_ä', 'slow_ä')}.mp4")
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}.mp4") == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        "levels of speed, with their clips: fast_ä_1 (1), fast_ä_2 (1), slow_ä_1 (1), slow_ä_2 (1)",
        "levels of speed end in numbers (fast_ä_1); if they number the clips, use '{speed}_{exemplar}.mp4'",
    ]


def test_numbers_are_levels(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4") == 0
    assert capsys.readouterr().out.splitlines()[:-1] == ["levels of speed, with their clips: 2 (2), 10 (2)"]


def test_levels_that_cannot_be_rendered_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    out = clips.parent / "out"
    assert stimuli(monkeypatch, "build", clips.parent / "robots.toml", "--out", out) != 0
    assert "'10' and '2' do not change the rendering" in capsys.readouterr().err
    assert not out.exists()


def test_other_videos_are_converted_into_a_folder_that_a_server_takes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    for number, (ending, settings) in enumerate(ODD.items(), start=3):
        write_video(clips / f"10_ä_{number}{ending}", **settings)
        write_video(clips / f"2_ä_{number}{ending}", **settings)
    before = {path.name: path.read_bytes() for path in clips.iterdir()}
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4") == 0
    assert "10 clips in 2 cells, 6 converted; wrote" in " ".join(capsys.readouterr().out.split())
    assert {path.name: path.read_bytes() for path in clips.iterdir() if path.is_file()} == before
    manifest = read_manifest(clips / "clips")
    check_files(manifest, clips / "clips")
    check_originals(manifest, clips / "clips")
    assert [clip.source and clip.source.changes for clip in manifest.clips[:5]] == [
        None, None, ("encoded as H.264, was vp9",), ("turned by 90 degrees to the left, as the file says",),
        ("sound left out",),
    ]  # fmt: skip
    turned = manifest.clips[3]
    assert (turned.width_px, turned.height_px) == (HEIGHT, WIDTH)
    assert all(examine(clips / "clips" / clip.file).codec == "h264" for clip in manifest.clips)
    store = FolderStore(clips.parent / "store")
    assert store_clips(store, manifest, clips / "clips") == len({clip.sha256 for clip in manifest.clips})
    assert all(store.size(source.sha256) == source.bytes for source in manifest.sources)


def test_videos_that_cannot_be_clips_are_all_named_and_nothing_is_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    write_sound(clips / "2_ä_2.mp4")
    (clips / "10_ä_2.mp4").write_bytes(b"no video")
    before = sorted(path.name for path in clips.iterdir())
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4") != 0
    printed = " ".join(capsys.readouterr().err.split())
    assert "2 of 4 videos cannot become clips; 10_ä_2.mp4: " in printed
    assert "2_ä_2.mp4: it holds audio and no picture; expected a video" in printed
    assert sorted(path.name for path in clips.iterdir()) == before


def test_originals_stay_where_the_manifest_would_take_their_place(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    write_video(clips / "2_ä_2.mp4", sound=True)
    asked = ("manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4", "--out", clips)
    assert stimuli(monkeypatch, *asked) != 0
    assert "1 of 4 videos have to be converted" in " ".join(capsys.readouterr().err.split())
    assert not (clips / "manifest.json").exists()


def test_an_original_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch, clips: Path) -> None:
    write_video(clips / "2_ä_2.mp4", sound=True)
    assert stimuli(monkeypatch, "manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4") == 0
    made = clips / "clips"
    (made / "2_ä_2.original.mp4").unlink()
    with pytest.raises(InputError, match=r"original 2_ä_2\.original\.mp4, .* is missing"):
        check_originals(read_manifest(made), made)


OWN: dict[str, dict[str, Any]] = {
    "B-frames": {"options": {"x264-params": "bframes=3:b-adapt=0:log-level=error"}},
    "no B-frames": {"options": {"x264-params": "bframes=0:log-level=error"}},
    "a rate beyond whole numbers": {"fps": 24},
}


@pytest.mark.parametrize("kind", OWN)
@pytest.mark.parametrize("ending", [".mp4", ".mov", ".mkv"])
def test_what_manifest_takes_verify_takes_too(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, kind: str, ending: str
) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in ("slow_1", "fast_1"):
        write_video(folder / f"{name}{ending}", **OWN[kind])
    assert stimuli(monkeypatch, "manifest", folder, "--pattern", f"{{speed}}_{{exemplar}}{ending}") == 0
    made = folder if (folder / "manifest.json").exists() else folder / "clips"
    assert stimuli(monkeypatch, "verify", made) == 0


def test_a_quicktime_clip_of_an_older_manifest_is_named_with_advice_that_can_be_followed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clips: Path
) -> None:
    arguments = ("manifest", clips, "--pattern", "{speed}_ä_{exemplar}.mp4")
    assert stimuli(monkeypatch, *arguments) == 0
    for path in clips.glob("*.mp4"):  # as a release that took them left them
        content = path.read_bytes()
        path.write_bytes(content[:8] + b"qt  " + content[12:])
    manifest = read_manifest(clips)
    again = [clip.model_copy(update={"sha256": file_sha256(clips / clip.file)}) for clip in manifest.clips]
    text = manifest.model_copy(update={"clips": tuple(again)}).model_dump_json()
    (clips / "manifest.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="is a QuickTime file"):
        store_clips(FolderStore(clips.parent / "store"), read_manifest(clips), clips)
    assert stimuli(monkeypatch, "verify", clips) != 0
    told = capsys.readouterr()
    assert "was QuickTime" in told.out
    assert "run `stimuli manifest` again" in told.err
    assert stimuli(monkeypatch, *arguments, "--out", clips.parent / "again") == 0
    assert stimuli(monkeypatch, "verify", clips.parent / "again") == 0
    store_clips(
        FolderStore(clips.parent / "store"), read_manifest(clips.parent / "again"), clips.parent / "again"
    )


def test_levels_that_differ_in_what_a_performance_ignores_are_refused() -> None:
    text = (REPOSITORY / "experiments" / "pairs-demo.toml").read_text(encoding="utf-8")
    text = text.replace('profile = "SL"', 'profile = "phases", anticipation = 1.0, settle = 0.5')
    check_levels(parse_experiment(text))
    performed = text.replace("[exemplars]", '[render]\nperformance = "uniform"\n\n[exemplars]', 1)
    with pytest.raises(InputError, match="'model' and 'textbook' do not change the rendering"):
        check_levels(parse_experiment(performed))
