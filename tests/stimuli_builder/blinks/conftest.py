"""What the blink tests share: an artificial recording with known blinks, and the command line."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from stimuli_builder.blinks.profile import Array
from stimuli_builder.cli import main


@dataclass(frozen=True)
class Known:
    """A distance series in px with blinks of known onset, minimum and end (frames)."""

    distance: Array
    fps: float
    onsets: tuple[int, ...]
    minima: tuple[int, ...]
    ends: tuple[int, ...]


def known_series(
    fps: float = 300.0,
    depths: tuple[float, ...] = (1.0, 0.6, 0.95, 1.0),
    opening: float = 34.0,
    noise: float = 0.0,
) -> Known:
    """Blinks every 2 s: raised-cosine phases of 90 and 210 ms."""
    down, up = round(0.09 * fps), round(0.21 * fps)
    frames = np.arange(round((2 * len(depths) + 2) * fps))
    closure = np.zeros(frames.size)
    minima = [round((2 * number + 2) * fps) for number in range(len(depths))]
    for minimum, depth in zip(minima, depths, strict=True):
        place = frames - minimum
        falling = (1 + np.cos(np.pi * np.clip(place / down, -1, 0))) / 2
        rising = (1 + np.cos(np.pi * np.clip(place / up, 0, 1))) / 2
        closure += depth * np.where(place <= 0, falling, rising)
    jitter = np.random.default_rng(1).normal(0, noise, frames.size) if noise else 0.0
    distance = np.maximum(opening * (1 - closure) + jitter, 0.0)
    edges = (tuple(m - down for m in minima), tuple(minima), tuple(m + up for m in minima))
    return Known(distance, fps, *edges)


@pytest.fixture(scope="session")
def make_known() -> Callable[..., Known]:
    return known_series


@dataclass(frozen=True)
class Ended:
    """How a call of `stimuli` ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def stimuli(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """Call `stimuli` as from a shell."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["stimuli", *map(str, arguments)])
        code: object = 0
        try:
            main()
        except SystemExit as exit_:
            code = exit_.code or 0
        captured = capsys.readouterr()
        return Ended(int(str(code)), captured.out, captured.err)

    return call


@pytest.fixture
def series_file(tmp_path: Path) -> Path:
    """A plain series CSV of both eyes, 300 fps, four blinks each, the right eye's less deep."""
    left, right = known_series(noise=0.05), known_series(depths=(0.9, 0.5, 0.9, 0.95), noise=0.05)
    path = tmp_path / "series.csv"
    rows = [
        f"{k},{a:.4f},{b:.4f}" for k, (a, b) in enumerate(zip(left.distance, right.distance, strict=True))
    ]
    path.write_text("\n".join(["frame,gap_l,gap_r", *rows]) + "\n", encoding="utf-8")
    return path
