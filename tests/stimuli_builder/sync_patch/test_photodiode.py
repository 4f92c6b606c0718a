"""Traces of a photodiode made here."""

from pathlib import Path

import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.sync_patch.cli import scope
from stimuli_builder.sync_patch.onsets import changes, read_trace
from tests.stimuli_builder.sync_patch.films import Shown, steady

FPS, FRAMES = 30.0, 11
PERIOD_MS = 1000 / FPS


def write_trace(path: Path, shown: Shown, until_ms: float = 700.0) -> Path:
    """1 kHz, with the slow rise of a screen's pixels and noise."""
    times = np.arange(0, until_ms)
    light = np.array([1.0 if (frame := shown.at(at)) is None else frame % 2 for at in times])
    risen = np.convolve(np.pad(light, (4, 0), mode="edge"), np.ones(5) / 5, "valid")
    values = 0.3 + 2 * risen + np.random.default_rng(1).normal(0, 0.05, len(times))
    lines = [f"{at},{value:.4f}" for at, value in zip(times, values, strict=True)]
    path.write_text("\n".join(["time_ms,value", *lines]))
    return path


def test_every_change_is_found(tmp_path: Path) -> None:
    shown = steady(FRAMES, FPS)
    found = changes(read_trace(write_trace(tmp_path / "diode.csv", shown)), FPS)
    [times] = found.plays
    assert len(times) == FRAMES + 1
    off = np.array(times[:FRAMES]) - np.array(list(shown.onsets_ms.values()))
    assert np.abs(off - np.median(off)).max() < 2.5


def test_a_missing_frame_is_a_long_interval(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = steady(FRAMES, FPS)
    del shown.onsets_ms[5]
    scope(write_trace(tmp_path / "diode.csv", shown), fps=FPS)
    assert "1 longer than a frame and a half" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_ms,value\n0,1\n0,2\n", "expected times in ms that increase"),
        ("time_ms,value\n0,one\n", "expected two columns of numbers"),
        ("time_ms,value\n", "has a header but no rows"),
    ],
)
def test_bad_traces_are_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "diode.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_trace(path)


def test_the_rate_must_be_given_for_a_trace(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--fps 30"):
        scope(tmp_path / "diode.csv")
