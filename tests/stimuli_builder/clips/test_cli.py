"""The commands plan, build, clip and verify, as a person types them."""

import json
from pathlib import Path

import av
import pytest
from PIL import Image

from experiments.load import load_experiment
from stimuli_builder.blinks.library import load_library
from stimuli_builder.cli import main
from stimuli_builder.clips.characters import geometry, shipped_names
from stimuli_builder.clips.geometry import Geometry
from tests.helpers.tiny_clips import make_clip_folder

from .conftest import Small


def stimuli(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command in this process; returns its exit code."""
    monkeypatch.setattr("sys.argv", ["stimuli", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    return int(stopped.value.code or 0)


@pytest.mark.parametrize(
    ("name", "cells", "clips", "trials", "blocks"),
    [("exp1", 16, 320, 320, [160] * 2), ("exp2", 40, 200, 400, [100] * 4), ("exp3", 4, 80, 160, [80] * 2)],
)
def test_plan_gives_the_papers_counts(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    cells: int,
    clips: int,
    trials: int,
    blocks: list[int],
) -> None:
    assert stimuli(monkeypatch, "plan", name, "--json") == 0
    plan = json.loads(capsys.readouterr().out)
    assert (len(plan["cells"]), plan["unique_clips"], plan["trials_per_participant"]) == (
        cells,
        clips,
        trials,
    )
    assert [block["trials"] for block in plan["blocks"]] == blocks
    assert set(plan) >= {"factors", "expected_minutes"}


def test_plan_prints_the_recordings_shown_twice(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stimuli(monkeypatch, "plan", "exp1") == 0
    printed = capsys.readouterr().out
    assert "320 unique clips" in printed
    assert printed.count("exemplar ") == max(0, 20 - len(load_library()))


def test_plan_counts_one_of_a_thing_as_one(capsys: pytest.CaptureFixture[str]) -> None:
    from experiments.load import load_experiment
    from stimuli_builder.clips.plan import print_plan, summary

    plan = summary(load_experiment("exp3"))
    ones = ("participants", "exemplars_per_cell", "unique_clips", "trials_per_participant", "practice_trials")
    one_block = [plan["blocks"][0] | {"trials": 1}]
    print_plan(plan | dict.fromkeys(ones, 1) | {"blocks": one_block, "expected_minutes": 1.2})
    printed = capsys.readouterr().out
    for words in ("(1 participant)", "4 cells x 1 exemplar = 1 unique clip\n", "1 trial per", "in 1 block: "):
        assert words in printed
    assert "(1 trial)" in printed
    assert "1 practice trial; about 1 minute\n" in printed


def test_build_with_preview(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    small: Small,
    built: Path,
    tmp_path: Path,
) -> None:
    out = tmp_path / "clips"
    assert stimuli(monkeypatch, "build", small.toml, "--out", out, "--workers", 1, "--preview") == 0
    assert "8 clips" in capsys.readouterr().out
    assert (out / "manifest.json").read_bytes() == (built / "manifest.json").read_bytes()
    with Image.open(out / "preview.png") as sheet:
        assert sheet.height == 4 * 77
    page = (out / "preview.html").read_text()
    assert all(clip["file"] in page for clip in json.loads((out / "manifest.json").read_text())["clips"])
    assert "http://www.w3.org/2000/svg" in page
    assert page.count("http") == 1
    assert stimuli(monkeypatch, "build", small.toml, "--out", out, "--quiet-when-current") == 0
    assert capsys.readouterr().out == ""


def test_a_log_gets_a_line_per_tenth_of_the_clips(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`make run` prints nothing else while clips are rendered, where its output is not a terminal."""
    make_clip_folder(load_experiment("exp3"), tmp_path)
    assert stimuli(monkeypatch, "siti", tmp_path) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("measuring")]
    assert lines == [f"measuring: {done} of 80 clips" for done in range(8, 81, 8)]


def test_verify_says_what_it_measured(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], small: Small, built: Path
) -> None:
    assert stimuli(monkeypatch, "verify", built, "--characters", small.folder) == 0
    assert "opening measured in 8" in capsys.readouterr().out


def test_one_clip(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "clip.mp4"
    arguments = (
        "--profile",
        "AL_ease",
        "--duration",
        7,
        "--size",
        "320x120",
        "--fps",
        60,
        "--clip-frames",
        90,
    )
    assert stimuli(monkeypatch, "clip", *arguments, "--no-blur", "--out", out) == 0
    assert "90 frames at 60 fps" in capsys.readouterr().out
    with av.open(str(out)) as container:
        assert len(list(container.decode(video=0))) == 90


@pytest.mark.parametrize("name", shipped_names())
def test_a_clip_of_each_character_may_have_its_own_size(name: str) -> None:
    assert geometry(name).clip_size_px() == geometry(name).size_px


@pytest.mark.parametrize(
    "name",
    [next(name for name in shipped_names() if name.startswith(of)) for of in ("alder-face", "cartoon")],
)
def test_a_clip_has_its_characters_own_size(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    out = tmp_path / "clip.mp4"
    short = ("--profile", "AL", "--duration", 5, "--clip-frames", 45, "--no-blur")
    assert stimuli(monkeypatch, "clip", *short, "--character", name, "--out", out) == 0
    with av.open(str(out)) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height) == geometry(name).size_px


@pytest.mark.parametrize(
    ("own", "size"),
    [
        ((720, 900), (720, 900)),
        ((1080, 1920), (676, 1200)),
        ((3840, 2160), (1920, 1080)),
        ((241, 91), (320, 120)),
        ((641, 361), (642, 362)),
    ],
)
def test_the_default_size_is_one_that_a_clip_may_have(own: tuple[int, int], size: tuple[int, int]) -> None:
    character = Geometry("some", own, 6.0, 60.0, 10.0, None)
    assert character.clip_size_px() == size
    assert character.scaled(*size)[1] == 0


def test_a_clip_of_a_file_with_decimal_commas(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, out = tmp_path / "blink.csv", tmp_path / "clip.mp4"
    file.write_text("closure;lower_up_mm\n" + "".join(f"0,{n};0\n" for n in (0, 2, 4, 6, 8, 9, 7, 5, 3, 1)))
    call = ("--profile", file, "--size", "320x120", "--out", out)
    assert stimuli(monkeypatch, "clip", *call) == 0
    said = "columns separated by semicolons, decimal commas (e.g. '0,0') read as decimal points"
    assert capsys.readouterr().err == f"note: blink.csv: {said}\n"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--profile", "modell"), "no blink profile 'modell'; did you mean 'model'"),
        (("--profile", "nowhere.csv"), "nowhere.csv"),
        (("--character", "cartoonn"), "no character 'cartoonn'"),
        (("--size", "big"), "expected WIDTHxHEIGHT"),
        (("--size", "4000x360"), "--size (width): expected at most"),
        (("--duration", -4), "error: --duration: expected 3 or more, got -4"),
        (("--duration", "nan"), "error: --duration: expected a number, got nan"),
        (("--duration-ms", "nan"), "error: --duration-ms: expected a number, got nan"),
        (("--lower-lid", "both"), "has no lower-lid layer"),
        (("--clip-frames", 12), "longer than the clip of 12 frames"),
        (("--clip-frames", 99999999), "--clip-frames: expected at most 5,000"),
        (("--duration", 9, "--duration-ms", 300), "error: expected --duration or --duration-ms, got both"),
        (("--profile", "espbm-left-01", "--eyes", "separate"), "shows one eye"),
        (("--profile", "real", "--exemplar", 100000), f"expected 1 to {len(load_library())}, the blinks of"),
        (("--profile", "espbm-left-01", "--exemplar", 2), "--exemplar: expected 1, the only blink of"),
    ],
)
def test_bad_input_ends_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    arguments: tuple[object, ...],
    line: str,
) -> None:
    out = tmp_path / "clip.mp4"
    assert stimuli(monkeypatch, "clip", *arguments, "--out", out) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("error: ")
    assert line in printed
    assert printed.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_clip_is_called_what_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert stimuli(monkeypatch, "clip", "--out", tmp_path / "one.avi") == 2
    assert "--out: expected a name ending in .mp4, got 'one.avi'" in capsys.readouterr().err


def test_a_failed_check_exits_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert stimuli(monkeypatch, "verify", tmp_path) == 2
    assert "error: expected a manifest.json" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["plan", "build", "clip", "verify"])
def test_help_has_examples(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert stimuli(monkeypatch, command, "--help") == 0
    assert f"stimuli {command} " in capsys.readouterr().out
