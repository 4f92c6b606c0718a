"""Which columns are labelled, which of them are two eyes, and what is said of others."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.columns import choose_columns, eye_pair
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.series import BlinkSeries, read_series

FPS = 120.0


def write(path: Path, **columns: object) -> Path:
    pd.DataFrame(columns).to_csv(path / "s.csv", index=False)
    return path / "s.csv"


@pytest.mark.parametrize(
    ("columns", "pair"),
    [
        (("EAR_l", "EAR_r"), (0, 1)),
        (("nose", "EAR_r", "EAR_l"), (2, 1)),
        (("EAR_l", "EAR_r", "gap_l"), None),
        (("a", "b"), None),
        ((), None),
    ],
)
def test_two_eyes_are_one_left_and_one_right(columns: tuple[str, ...], pair: tuple[int, int] | None) -> None:
    assert eye_pair(columns) == pair


@pytest.mark.parametrize("others", [(), ("time_s", "frame", "left_valid")], ids=["alone", "with times"])
def test_one_left_and_one_right_eye_are_taken_without_being_named(tmp_path: Path, others: tuple) -> None:
    values = np.random.default_rng(1).normal(10, 1, (2, 50))
    ones = {name: np.arange(50) / 100 if name == "time_s" else np.ones(50, int) for name in others}
    table = pd.DataFrame({"EAR_r": values[0], "EAR_l": values[1], **ones})
    columns, notes = choose_columns(table, (), tmp_path / "s.csv")
    assert columns == ["EAR_r", "EAR_l"]
    assert notes == ["s.csv: 'EAR_r' and 'EAR_l' are used as the two eyes; select others with --column NAME"]


@pytest.mark.parametrize("names", [("EAR_l", "EAR_r", "EAR_mean"), ("a", "b"), ("EAR_l", "gap_l")])
def test_columns_that_are_not_a_one_pair_of_eyes_are_to_be_named(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    table = pd.DataFrame({name: np.linspace(1.5, 2.5, 50) + n for n, name in enumerate(names)})
    with pytest.raises(InputError, match="select the series with --column"):
        choose_columns(table, (), tmp_path / "s.csv")


def test_two_of_three_columns_are_judged_as_eyes(make_known) -> None:
    distance = make_known(fps=FPS, noise=1.0).distance
    rng = np.random.default_rng(1)
    eyes = [
        BlinkSeries(distance=one, fps=FPS, column=name, is_px=False)
        for name, one in (
            ("EAR_mean", distance + rng.normal(0, 0.2, distance.size)),
            ("EAR_r", np.full(distance.size, 20.0) + rng.normal(0, 0.2, distance.size)),
            ("EAR_l", distance),
        )
    ]
    mean, still, moving = recognise(eyes)
    assert (still, moving) == tuple(recognise(eyes[1:]))
    assert still.asymmetry is not None
    assert still.asymmetry.is_weak
    assert mean == recognise(eyes[:1])[0]


def test_blinks_of_two_of_three_columns_are_paired(stimuli, series_file: Path, tmp_path: Path) -> None:
    table = pd.read_csv(series_file)
    table["mean"] = (table["gap_l"] + table["gap_r"]) / 2
    table.to_csv(tmp_path / "s.csv", index=False)
    names = [word for name in ("mean", "gap_l", "gap_r") for word in ("--column", name)]
    files = ("--out", tmp_path / "b.csv", "--report", tmp_path / "r.html")
    ended = stimuli("blinks", tmp_path / "s.csv", *names, "--fps", 300, *files)
    assert ended.code == 0, ended.err
    assert "no two" not in ended.err
    assert pd.read_csv(tmp_path / "b.csv").groupby("column")["partner"].count().to_dict() == {
        "gap_l": 4, "gap_r": 4, "mean": 0,
    }  # fmt: skip
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "4 blinks in both eyes; 0 only in gap_l, 0 only in gap_r" in page


def test_columns_of_which_no_two_are_eyes_are_reported(stimuli, series_file: Path, tmp_path: Path) -> None:
    table = pd.read_csv(series_file).rename(columns={"gap_r": "b"})
    table["c"] = table["gap_l"] * 0.9
    table.to_csv(tmp_path / "s.csv", index=False)
    names = [word for name in ("gap_l", "b", "c") for word in ("--column", name)]
    ended = stimuli("blinks", tmp_path / "s.csv", *names, "--fps", 300, "--out", tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    assert ended.err == (
        "note: no two of the 3 columns (gap_l, b, c) are named as left and right eye: each is judged "
        "separately, and an eye that moves less is not reported\n"
    )


def test_a_presence_is_not_a_second_eye(make_known, tmp_path: Path) -> None:
    closure = 3 * (1 - make_known(fps=FPS, noise=0.3).distance.clip(0, 34) / 34)
    path = write(tmp_path, AU45_r=closure, AU45_c=(closure > 1).astype(float))
    for named in ((), ("AU45_r", "AU45_c")):
        (series,) = read_series(path, named, FPS)
        assert series.column == "AU45_r"
    assert "s.csv: 'AU45_c' has only 0 and 1, so it is not an eye opening: ignored" in series.notes
    assert [one.column for one in read_series(path, ["AU45_c"], FPS)] == ["AU45_c"]


def test_columns_that_are_the_same_are_not_two_eyes(make_known, tmp_path: Path) -> None:
    distance = make_known(fps=FPS, noise=0.3).distance
    path = write(tmp_path, EAR_l=distance, EAR_r=distance)
    (series,) = read_series(path, ["EAR_l", "EAR_r"], FPS)
    assert series.column == "EAR_l"
    assert series.notes == (
        "s.csv: 'EAR_r' has the same values as 'EAR_l', so it is not a second eye: ignored",
    )


def test_columns_of_whole_numbers_are_reported_and_taken_by_name(make_known, tmp_path: Path) -> None:
    gap = np.round(make_known(fps=FPS, noise=0.3).distance * 10).astype(int)
    path = write(tmp_path, frame=range(gap.size), gap=gap, label="x", seen=(gap > 50).astype(int))
    with pytest.raises(InputError) as error:
        read_series(path, fps=FPS)
    assert str(error.value) == (
        "s.csv: expected a column of decimal numbers, got 'gap' (whole numbers), 'seen' (whole numbers); if "
        "one of them is the distance, select it with --column"
    )
    assert [one.column for one in read_series(path, ["gap"], FPS)] == ["gap"]


@pytest.mark.parametrize(("fps", "told"), [(12.0, True), (15.0, False), (1000.0, False), (1200.0, True)])
def test_a_rate_beyond_those_tested_is_reported(
    stimuli, make_known, tmp_path: Path, fps: float, told: bool
) -> None:
    path = write(tmp_path, gap_l=make_known(fps=fps, noise=0.05).distance)
    files = ("--out", tmp_path / "b.csv", "--report", tmp_path / "r.html")
    ended = stimuli("blinks", path, "--column", "gap_l", "--fps", fps, *files)
    assert ended.code == 0, ended.err
    line = f"the classifier was tested at 15 to 1,000 frames per second, but this is {fps:g}"
    assert ended.err.count(f"warning: {line}") == told
    assert (line in (tmp_path / "r.html").read_text(encoding="utf-8")) == told
    rule = ("--preset", "velocity", "--out", tmp_path / "c.csv")
    assert line not in stimuli("blinks", path, "--column", "gap_l", "--fps", fps, *rule).err
