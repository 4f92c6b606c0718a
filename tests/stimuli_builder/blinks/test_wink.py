"""A wink among blinks of both eyes is a blink of one eye."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stimuli_builder.blinks.events.recognise import RecognisedEvents, recognise
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries

DEPTHS = (0.95, 1.0, 0.9, 0.95, 1.0, 0.9)
WINK = 2
WINK_S = 2 * WINK + 2


def face(make_known, fps: float, noise: float, *, wink: float = 0.97, other: float = 0.0) -> list[Array]:
    """Both eyes' distances; at `WINK_S` the left one closes by `wink`, the right one by `other`."""
    eyes = []
    for seed, depth in ((1, wink), (2, other)):
        depths = [depth if n == WINK else one for n, one in enumerate(DEPTHS)]
        clean = make_known(fps=fps, depths=tuple(depths)).distance + 4
        eyes.append(clean + np.random.default_rng(seed).normal(0, noise * 34, clean.size))
    return eyes


def told(eyes: list[Array], fps: float) -> list[RecognisedEvents]:
    names = ("EAR_l", "EAR_r")
    return recognise(
        [
            BlinkSeries(distance=one, fps=fps, column=n, is_px=False)
            for n, one in zip(names, eyes, strict=True)
        ]
    )


def blinks(one: RecognisedEvents) -> list[float]:
    return [event.minimum_s for event in one.events if event.kind == "blink"]


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize("noise", [0.003, 0.015])
def test_a_wink_is_reported_for_its_eye_alone(make_known, fps: float, noise: float) -> None:
    left, right = told(face(make_known, fps, noise), fps)
    times = [2.0 * n + 2 for n in range(len(DEPTHS))]
    assert blinks(left) == pytest.approx(times, abs=0.06)
    assert blinks(right) == pytest.approx([one for one in times if one != WINK_S], abs=0.06)


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_a_small_dip_of_one_eye_is_not_a_wink(make_known, fps: float) -> None:
    left, right = told(face(make_known, fps, 0.015, wink=0.3), fps)
    for eye in (left, right):
        assert not any(abs(time - WINK_S) < 0.3 for time in blinks(eye))


def test_a_wink_is_in_the_table_and_said_unless_rejected(stimuli, make_known, tmp_path: Path) -> None:
    left, right = face(make_known, 120.0, 0.01)
    pd.DataFrame({"EAR_l": left, "EAR_r": right}).to_csv(tmp_path / "s.csv", index=False)
    ended = stimuli(
        "blinks", tmp_path / "s.csv", "--column", "EAR_l", "--column", "EAR_r", "--fps", 120,
        "--out", tmp_path / "b.csv",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    table = pd.read_csv(tmp_path / "b.csv")
    alone = table[table["partner"].isna()]
    assert alone["column"].to_list() == ["EAR_l"]
    assert alone["minimum_s"].to_list() == pytest.approx([WINK_S], abs=0.05)
    assert "note: left eye (EAR_l): 1 blink of this eye only, the other eye open, first at 6.0 s" in ended.err
    page, reject = tmp_path / "r.html", f"EAR_l:{WINK + 1}=talking"
    ended = stimuli(
        "blinks", tmp_path / "s.csv", "--column", "EAR_l", "--column", "EAR_r", "--fps", 120,
        "--out", tmp_path / "b.csv", "--review", tmp_path / "v.csv", "--reject", reject, "--report", page,
    )  # fmt: skip
    assert ended.code == 0, ended.err
    assert "of this eye only" not in ended.err + page.read_text(encoding="utf-8")
