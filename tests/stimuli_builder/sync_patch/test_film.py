"""Films made here, of a screen whose frames are known, read by `stimuli scope`."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.sync_patch import film as patch_code
from stimuli_builder.sync_patch.cli import scope
from stimuli_builder.sync_patch.film import read_film
from stimuli_builder.sync_patch.onsets import PlayOnScreen, plays
from tests.golden import sync_patch
from tests.stimuli_builder.sync_patch.films import LEAD_MS, Camera, Shown, film, steady

FRAMES, FPS = 12, 30.0
PERIOD_MS = 1000 / FPS
UNTIL_MS = LEAD_MS + FRAMES * PERIOD_MS + 150
PHONE = Camera()


def read(path: Path, frames: int | None = FRAMES) -> PlayOnScreen:
    taken = read_film(path)
    [play] = plays(taken.times_ms, taken.numbers, frames=frames)
    return play


def assert_onsets(play: PlayOnScreen, shown: Shown, within_ms: float) -> None:
    """Each frame's onset against the truth; the shutter's way down to the patch is the same for all."""
    off = np.array([onset.at_ms - shown.onsets_ms[onset.frame] for onset in play.onsets])
    assert np.abs(off - np.median(off)).max() < within_ms


@given(st.integers(0, 2**20))
def test_a_number_reads_as_itself_and_its_neighbour_differs_in_two_fields(number: int) -> None:
    white = patch_code.fields_of_number(number)
    assert patch_code.read_numbers(white[None].astype(float)).tolist() == [number % patch_code.NUMBERS]
    assert (white != patch_code.fields_of_number(number + 1)).sum() == 2


@given(st.integers(0, 255), st.floats(0.4, 0.6))
def test_a_picture_half_way_between_two_frames_is_neither(number: int, share: float) -> None:
    mixed = (1 - share) * patch_code.fields_of_number(number) + share * patch_code.fields_of_number(
        number + 1
    )
    assert patch_code.read_numbers(mixed[None]).tolist() == [patch_code.UNREADABLE]


def test_no_frame_is_distinguished_from_every_frame() -> None:
    assert patch_code.read_numbers(np.ones((1, 9))).tolist() == [patch_code.NO_FRAME]
    assert not any(patch_code.fields_of_number(number).all() for number in range(patch_code.NUMBERS))


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_every_frame_on_time_whichever_way_the_phone_is_held(tmp_path: Path, turns: int) -> None:
    shown = steady(FRAMES, FPS)
    play = read(film(tmp_path / "film.mp4", shown, replace(PHONE, turns=turns), UNTIL_MS))
    assert (play.missing, play.fps) == ([], FPS)
    assert_onsets(play, shown, 1000 / 240)
    assert max(abs(late) for late in play.late_ms) < 1000 / 240


def test_a_missing_frame_and_a_late_one_are_named(tmp_path: Path) -> None:
    shown = steady(FRAMES, FPS)
    late = shown.onsets_ms | {9: shown.onsets_ms[9] + 17}
    del late[7]
    play = read(film(tmp_path / "film.mp4", Shown(late, shown.ended_ms), PHONE, UNTIL_MS))
    assert play.missing == [7]
    by_frame = dict(zip((onset.frame for onset in play.onsets), play.late_ms, strict=True))
    assert by_frame[9] == pytest.approx(17, abs=1000 / 240)
    assert {frame for frame, off in by_frame.items() if abs(off) > 5} == {9}


@pytest.mark.parametrize(
    "camera",
    [replace(PHONE, rolling_ms=4.1, exposure=0.95), replace(PHONE, noise=20.0), replace(PHONE, crf=38)],
)
def test_long_exposure_noise_and_compression_cost_no_frame(tmp_path: Path, camera: Camera) -> None:
    shown = steady(FRAMES, 60.0)
    play = read(film(tmp_path / "film.mp4", shown, camera, LEAD_MS + 350))
    assert (play.missing, play.fps) == ([], 60.0)
    assert_onsets(play, shown, 1.5 * 1000 / 240)


def test_the_command_names_the_missing_frame_and_writes_onsets(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = steady(FRAMES, FPS)
    del shown.onsets_ms[3]
    path = film(tmp_path / "film.mp4", shown, PHONE, UNTIL_MS)
    scope(path, out=tmp_path / "onsets.csv")
    printed = capsys.readouterr().out
    assert "1 missing (3)" in printed
    assert "0 of 1 presentation(s) without a missing frame" in printed
    rows = list(csv.DictReader((tmp_path / "onsets.csv").read_text().splitlines()))
    assert [int(row["frame"]) for row in rows] == [*range(3), *range(4, FRAMES)]
    assert float(rows[2]["interval_ms"]) == pytest.approx(2 * PERIOD_MS, abs=9)


def test_a_slow_motion_file_needs_the_camera_s_rate(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mp4", steady(4, FPS), replace(PHONE, fps=30.0), 300)
    with pytest.raises(InputError, match=r"at least 100 frames per second, got 30.*--camera-fps 240"):
        read_film(path)


def test_a_film_without_a_patch_is_one_line(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mp4", Shown({}, 0.0), PHONE, 60)
    with pytest.raises(InputError, match=r"no sync patch was found\. Film the whole patch"):
        read_film(path)


def test_half_a_play_is_one_line() -> None:
    with pytest.raises(InputError, match="film from before the start key until after the clip"):
        plays(np.arange(4.0), np.array([0, 0, 1, patch_code.NO_FRAME]))


def test_the_page_draws_what_is_read_here() -> None:
    assert json.loads(sync_patch.FILE.read_text(encoding="utf-8")) == sync_patch.drawn()
