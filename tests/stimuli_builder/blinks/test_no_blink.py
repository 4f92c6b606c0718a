"""A recording without a blink: its report, its empty tables, and the distance at which its lids are shut."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stimuli_builder.blinks.profile import TABLE_COLUMNS, read_profile_table


@pytest.fixture
def still(make_known, tmp_path: Path) -> tuple[object, ...]:
    """A series of an eye that lowers its lid for seconds, and does not blink."""
    distance = make_known(fps=120.0, depths=(0.0,) * 4, noise=0.2).distance.copy()
    distance[600:900] -= 10 * np.sin(np.linspace(0, np.pi, 300))
    pd.DataFrame({"gap_l": distance}).to_csv(tmp_path / "still.csv", index=False)
    return ("blinks", tmp_path / "still.csv", "--column", "gap_l", "--fps", 120, "--out", tmp_path / "b.csv")


def test_a_recording_without_a_blink_has_a_report(stimuli, still, tmp_path: Path) -> None:
    ended = stimuli(*still)
    assert ended.code == 0
    assert "warning: no blink in column 'gap_l'" in ended.err
    assert len(pd.read_csv(tmp_path / "b.csv")) == 0
    files = ("--report", tmp_path / "r.html", "--summary", tmp_path / "s.json", "--plot", tmp_path / "p.png")
    ended = stimuli(*still, *files, "--plot-aligned", tmp_path / "a.png")
    assert ended.code == 0, ended.err
    assert "warning: no blink in column 'gap_l'" in ended.err
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "gap_l: no blinks in 10 s" in page
    cells = dict(re.findall(r'<th scope="row">([^<]+)</th><td>([^<]*)</td>', page))
    assert (cells["blinks"], cells["blinks per minute"]) == ("0", "0.0")
    (column,) = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))["columns"]
    assert (column["blinks"], column["rate_per_minute"]) == (0, 0)
    assert len(pd.read_csv(tmp_path / "b.csv")) == 0
    assert len(pd.read_csv(tmp_path / "b.profiles.csv")) == 0
    assert not (tmp_path / "a.png").exists()


def test_a_closed_distance_makes_a_curve_of_an_eye_without_a_blink(stimuli, still, tmp_path: Path) -> None:
    more = ("--report", tmp_path / "r.html", "--curve", tmp_path / "c.json", "--curve-format", "json")
    assert "so its closed level is unknown: add --closed" in stimuli(*still, *more).err
    ended = stimuli(*still, *more, "--lids", tmp_path / "l.csv", "--closed", 4)
    assert ended.code == 0, ended.err
    closure = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))["closure_left"]
    assert max(closure) == pytest.approx(1 / 3, abs=0.05)
    assert pd.read_csv(tmp_path / "l.csv")["gap_l_closure"].max() == pytest.approx(1 / 3, abs=0.05)


def test_tables_and_figures_of_an_earlier_run_are_not_left_as_if_they_were_of_this_one(
    stimuli, still, series_file, tmp_path: Path
) -> None:
    files = ("--plot-aligned", tmp_path / "a.png", "--report", tmp_path / "r.html")
    eye = ("--column", "gap_l", "--fps", 300, "--out", tmp_path / "b.csv")
    assert stimuli("blinks", series_file, *eye, *files).code == 0
    assert len(read_profile_table(tmp_path / "b.profiles.csv")) == 4
    ended = stimuli(*still, *files)
    assert ended.code == 0, ended.err
    assert list(pd.read_csv(tmp_path / "b.profiles.csv").columns) == list(TABLE_COLUMNS)
    assert len(pd.read_csv(tmp_path / "b.profiles.csv")) == 0
    assert "b.profiles.csv" in ended.out.replace("\n", "")  # a long path is wrapped
    assert f"note: {tmp_path / 'a.png'} is not written" in ended.err
    assert "the existing file is from an earlier run" in ended.err


def test_profiles_of_no_blink_make_no_model(stimuli, still, tmp_path: Path) -> None:
    assert stimuli(*still, "--report", tmp_path / "r.html").code == 0
    ended = stimuli("model", "fit", tmp_path / "b.profiles.csv", "--out", tmp_path / "m.json")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert "b.profiles.csv: the table has a header but no rows" in ended.err


@pytest.mark.parametrize("choice", [("--reject", "1=x"), ("--accept", "1"), ("--reject", "gap_l:1=x")])
def test_there_is_no_blink_to_decide_on(stimuli, still, tmp_path: Path, choice: tuple[str, str]) -> None:
    ended = stimuli(*still, "--report", tmp_path / "r.html", "--review", tmp_path / "rv.csv", *choice)
    assert ended.code == 2
    assert f"{' '.join(choice)}: there is no blink to decide on" in ended.err
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize("more", [("--curve", "c.csv"), ("--lids", "l.csv")])
def test_a_closed_distance_beyond_the_opening_of_an_eye_without_a_blink_is_refused(
    stimuli, still, monkeypatch, tmp_path: Path, more: tuple[str, str]
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = stimuli(*still, "--report", "r.html", *more, "--closed", 40)
    assert ended.code == 2
    assert "--closed 40 is not below the opening of 'gap_l' (up to 34" in ended.err
    assert "it must be the distance that remains when the lids meet" in ended.err
    assert {path.name for path in tmp_path.iterdir()} == {"still.csv"}
