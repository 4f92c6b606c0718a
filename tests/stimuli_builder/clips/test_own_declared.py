"""`stimuli manifest` says which factors, levels and cells of a declaration, or of a design, have no clips."""

from pathlib import Path

import pytest

from tests.stimuli_builder.clips.test_own_manifest import empty_videos, stimuli

SHAPES = """
name = "shapes"
title = "Shapes"
[[factors]]
name = "speed"
label = "Speed"
levels = [{ name = "slow", label = "s" }, { name = "medium", label = "m" }, { name = "fast", label = "f" }]
[[factors]]
name = "shape"
label = "Shape"
levels = [{ name = "disc", label = "d" }, { name = "square", label = "s" }]
[exemplars]
per_cell = 1
[trial.scale]
question = { en = "How alive?" }
low = { en = "not" }
high = { en = "very" }
[texts.en]
consent = "c"
instructions = "i"
debrief = "d"
"""
CELLS = [f"{speed}_{shape}.mp4" for speed in ("slow", "medium", "fast") for shape in ("disc", "square")]
BY_NAME = ("--pattern", "{speed}_{shape}.mp4")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (
            ["slwo_disc.mp4", *CELLS[1:]],
            "level 'slwo' of speed (slwo_disc.mp4) is not declared; did you mean 'slow'?",
        ),
        (
            [name.replace("medium", "medum") for name in CELLS],
            "of speed (medum_disc.mp4) is not declared; did you mean 'medium', which no clip has?",
        ),
        (
            [*CELLS, "slwo_ball.mp4"],
            "of speed (slwo_ball.mp4) is not declared; did you mean 'slow'? (and 1 more problem)",
        ),
        (
            [name for name in CELLS if "medium" not in name],
            "no clip has the level 'medium' of speed, which is declared; add its clips",
        ),
        (CELLS[:-1], "6 clips are declared, but 5 were found: fast/square, exemplar 1, is missing"),
    ],
    ids=["a slip", "a whole level", "two slips", "an unused level", "one clip"],
)
def test_clips_are_held_against_the_declaration(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    names: list[str], message: str,
) -> None:  # fmt: skip
    study = tmp_path / "shapes.toml"
    study.write_text(SHAPES, encoding="utf-8")
    folder = empty_videos(tmp_path / "clips", *names)
    assert stimuli(monkeypatch, "manifest", folder, *BY_NAME, "--experiment", study) == 2
    assert message in capsys.readouterr().err


def test_a_declared_factor_that_no_name_has_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    study = tmp_path / "shapes.toml"
    study.write_text(SHAPES, encoding="utf-8")
    folder = empty_videos(tmp_path / "clips", "slow.mp4", "fast.mp4")
    asked = ("manifest", folder, "--pattern", "{speed}.mp4", "--experiment", study)
    assert stimuli(monkeypatch, *asked) == 2
    assert "the clips have no levels of 'shape', a factor of shapes; add it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (CELLS[:-1], "in all 6 cells of the design, got 5 of them; none in fast/square\n"),
        (
            [f"{number}_{number}.mp4" for number in range(3)],
            "in all 9 cells of the design, got 3 of them; none in 0/1, 0/2, 1/0 and 3 more",
        ),
    ],
)
def test_cells_without_clips_are_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    names: list[str], message: str,
) -> None:  # fmt: skip
    folder = empty_videos(tmp_path / "clips", *names)
    assert stimuli(monkeypatch, "manifest", folder, *BY_NAME) == 2
    assert message in capsys.readouterr().err
