"""Making a study's checks: next to its clips, from a secret seed, whole or continued."""

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from experiments.errors import InputError
from experiments.load import parse_experiment
from experiments.manifest import MANIFEST_NAME, Manifest, check_files, read_manifest
from stimuli_builder.checks import plan as checks
from stimuli_builder.cli import app
from stimuli_builder.clips.build import Machines, build, silent
from stimuli_builder.clips.design_clips import Options
from stimuli_builder.clips.verify import verify

STUDY = """
name = "checked"
title = "A study with checks"
factors = [{ name = "speed", label = "Speed", levels = [
    { name = "fast", label = "Fast", render = { duration_frames = 8 } },
    { name = "slow", label = "Slow", render = { duration_frames = 14 } },
] }]
exemplars = { per_cell = 1 }
render = { character = "cartoon", width_px = 320, height_px = 120 }
blocks = { split_by = "speed" }

[evidence.motion_checks]
per_block = 2
kinds = ["digit", "direction", "first_eye"]
clips = 5
seconds = 1.2

[trial]
kind = "clip_rating"
[trial.scale]
question = { en = "How natural?" }
low = { en = "not" }
high = { en = "very" }

[texts.en]
consent = "c"
instructions = "i"
debrief = "d"
"""
EXPERIMENT = parse_experiment(STUDY)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the study's clips and checks: read it, do not change it."""
    folder = tmp_path_factory.mktemp("checked") / "clips"
    build(EXPERIMENT, folder, Options(checks_seed=5), Machines(workers=1))
    return folder


@pytest.fixture
def copied(built: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built, tmp_path / "clips"))


def answers(manifest: Manifest) -> list[tuple[str, int]]:
    return [(clip.check, clip.answer) for clip in manifest.checks]


def test_checks_are_next_to_the_clips_under_names_that_say_nothing(built: Path) -> None:
    manifest = read_manifest(built)
    check_files(manifest, built)
    assert len(manifest.clips) == 2
    assert [clip.check for clip in manifest.checks] == [
        "digit", "direction", "first_eye", "digit", "direction",
    ]  # fmt: skip
    assert all(clip.file == f"{clip.sha256}.mp4" for clip in manifest.checks)
    names = {path.name for path in built.iterdir()}
    assert names == {MANIFEST_NAME} | {clip.file for clip in manifest.files}
    assert {(clip.width_px, clip.height_px) for clip in manifest.checks} == {(240, 240), (320, 120)}
    assert not verify(built).findings


def test_checks_are_shown_at_the_clips_own_scale(built: Path) -> None:
    manifest = read_manifest(built)
    clip, check = manifest.clips[0], manifest.checks[0]
    assert clip.width_mm is not None
    assert check.width_mm == pytest.approx(clip.width_mm * 240 / 320, rel=1e-3)


def test_a_further_build_keeps_the_checks_and_renders_nothing(copied: Path) -> None:
    before = (copied / MANIFEST_NAME).read_bytes()
    report = build(EXPERIMENT, copied, Options(), Machines(workers=1))
    assert (report.built, report.removed) == (0, ())
    assert (copied / MANIFEST_NAME).read_bytes() == before


def test_checks_made_again_are_others_and_the_old_ones_go(copied: Path) -> None:
    before = read_manifest(copied)
    report = checks.build_checks(EXPERIMENT, copied, Options(), silent, anew=True)
    after = read_manifest(copied)
    assert report.built == 5
    assert set(report.removed) == {clip.file for clip in before.checks}
    assert after.checks_seed != before.checks_seed
    assert after.clips == before.clips
    assert {clip.sha256 for clip in after.checks}.isdisjoint(clip.sha256 for clip in before.checks)


def test_the_same_seed_makes_the_same_checks(copied: Path) -> None:
    before = read_manifest(copied)
    checks.build_checks(EXPERIMENT, copied, Options(checks_seed=6), silent)
    other = read_manifest(copied)
    assert answers(other) != answers(before) or other.checks != before.checks
    checks.build_checks(EXPERIMENT, copied, Options(checks_seed=5), silent)
    assert read_manifest(copied) == before


def test_an_interrupted_build_goes_on_with_its_secret_seed(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped: list[int] = []

    def stop_after_two(done: int, _total: int) -> None:
        stopped.append(done)
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(InputError, match="interrupted"):
        checks.build_checks(EXPERIMENT, copied, Options(), stop_after_two, anew=True)
    manifest = read_manifest(copied)
    check_files(manifest, copied)
    begun = (copied / checks.SEED_NAME).read_text()
    report = checks.build_checks(EXPERIMENT, copied, Options(), silent)
    assert report.built == 3
    assert str(read_manifest(copied).checks_seed) == begun
    assert not (copied / checks.SEED_NAME).exists()


def test_a_study_without_checks_has_a_manifest_without_them(tmp_path: Path) -> None:
    plain = parse_experiment(STUDY.replace("per_block = 2", "per_block = 0"))
    build(plain, tmp_path / "clips", Options(), Machines(workers=1))
    content = json.loads((tmp_path / "clips" / MANIFEST_NAME).read_text())
    assert "checks" not in content
    assert "checks_seed" not in content
    with pytest.raises(InputError, match="has no motion checks"):
        checks.build_checks(plain, tmp_path / "clips", Options(), silent)


def test_the_command_says_what_it_made(copied: Path, tmp_path: Path) -> None:
    toml = tmp_path / "checked.toml"
    toml.write_text(STUDY)
    run = CliRunner()
    made = run.invoke(app, ["checks", str(toml), "--out", str(copied), "--seed", "8"])
    assert made.exit_code == 0
    assert "checked: 5 clips of checks" in made.output
    assert read_manifest(copied).checks_seed == 8
    nowhere = run.invoke(app, ["checks", str(toml), "--out", str(tmp_path / "none")])
    assert isinstance(nowhere.exception, InputError)
    assert "build the clips first" in str(nowhere.exception)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("per_block = 2", "per_block = 11", "expected at most 10, got 11"),
        ("clips = 5", "clips = 3", "expected at least 4, one per check"),
        ('"first_eye"]', '"letter"]', "letter"),
        ("clips = 5", "clips = 5\ncontrast = 0.0", "expected more than 0, got 0.0"),
        ("clips = 5", "clips = 5\ndifficulty = nan", "expected a number, got nan"),
        (
            "clips = 5",
            "clips = 5\nwording = [{ check = 'shape', question = { en = 'q' }, choices = [] }]",
            "expected 4 choices for shape, got 0",
        ),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line(before: str, after: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_experiment(STUDY.replace(before, after))


def test_a_study_of_own_clips_needs_no_character(tmp_path: Path) -> None:
    text = STUDY.replace('render = { character = "cartoon", width_px = 320, height_px = 120 }\n', "")
    text = text.replace(", render = { duration_frames = 8 }", "").replace(
        ", render = { duration_frames = 14 }", ""
    )
    study = tmp_path / "own.toml"
    study.write_text(text, encoding="utf-8")
    planned = checks.planned_checks(parse_experiment(text), 5, Options(base_folder=tmp_path))
    assert [one.job.check for one in planned] == ["digit", "direction", "first_eye", "digit", "direction"]
    assert all(one.width_mm > 0 for one in planned)
