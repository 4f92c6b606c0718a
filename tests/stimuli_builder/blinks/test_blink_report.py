"""The report, every frame in units, and the recording as a curve."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.series import BlinkSeries
from stimuli_builder.blinks.units import INTER_OCULAR_MM, closure_course, lid_degrees, scale_of


@pytest.fixture
def labelled(stimuli, series_file, tmp_path):
    """`stimuli blinks` on both eyes with further arguments."""

    def run(*more):
        eyes = ("--column", "gap_l", "--column", "gap_r", "--fps", 300)
        return stimuli("blinks", series_file, *eyes, "--out", tmp_path / "b.csv", *more)

    return run


def test_the_report_is_one_page_with_a_value_for_each_eye(labelled, tmp_path):
    ended = labelled("--report", tmp_path / "r.html")
    assert ended.code == 0, ended.err
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)=["']?(?:https?:)?//""", page)
    assert page.count("<svg") == 2
    assert not re.search(
        r"(?<![\d.])-0(?:\.0+)?(?![\d.])", re.sub(r"<svg.*?</svg>|<style.*?</style>", "", page, flags=re.S)
    )
    cells = dict(re.findall(r'<th scope="row">([^<]+)</th><td>([^<]*)</td>', page))
    assert cells["blinks"] == "4"
    assert float(cells["blinks per minute"]) == pytest.approx(24, abs=0.2)
    assert cells["complete / partial"] == "2 / 2"
    duration = float(cells["duration, ms"].split()[0])
    assert duration == pytest.approx(pd.read_csv(tmp_path / "b.csv")["duration_ms"][:4].median(), abs=1)
    assert "4 blinks in both eyes; 0 only in gap_l, 0 only in gap_r" in page


def test_every_frame_has_its_closure(labelled, tmp_path, make_known):
    assert labelled("--lids", tmp_path / "l.csv").code == 0
    lids, known = pd.read_csv(tmp_path / "l.csv"), make_known(noise=0.05)
    assert list(lids.columns) == ["frame", "time_s", "gap_l", "gap_l_closure", "gap_r", "gap_r_closure"]
    assert lids["gap_l_closure"][known.minima[0]] == pytest.approx(1, abs=0.03)
    assert lids["gap_l_closure"][known.minima[1]] == pytest.approx(0.6, abs=0.03)
    assert lids["gap_l_closure"][known.onsets[0] - 60] == pytest.approx(0, abs=0.03)


def test_a_head_that_comes_nearer_closes_no_eye():
    near = np.linspace(1, 1.2, 6000)
    series = BlinkSeries(distance=30 * near, fps=300, column="d_px", is_px=True)
    assert closure_course(series, 0.0).max() < 0.06


@pytest.fixture
def close_up(make_known, tmp_path):
    """A track of a close-up, 34 px open."""
    known = make_known(noise=0.05)
    times = np.arange(known.distance.size) / known.fps
    path = tmp_path / "t.csv"
    pd.DataFrame({"time_s": times, "distance_px": known.distance, "status": "tracked"}).to_csv(
        path, index=False
    )
    return path


def test_a_scale_by_the_irises_makes_mm_of_px(stimuli, close_up, tmp_path):
    diameters = [*[""] * 20, *["46.8"] * 30, *["45.8"] * 10, *["48.8"] * 10]
    pd.DataFrame({"frame": range(70), "iris_diameter_px": diameters}).to_csv(tmp_path / "i.csv", index=False)
    files = ("--out", tmp_path / "b.csv", "--lids", tmp_path / "l.csv", "--report", tmp_path / "r.html")
    ended = stimuli("blinks", close_up, *files, "--scale", f"iris:{tmp_path / 'i.csv'}")
    assert ended.code == 0, ended.err
    lids = pd.read_csv(tmp_path / "l.csv")
    assert lids["distance_mm"].median() == pytest.approx(34 * 11.7 / 46.8, abs=0.02)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "0.2500 mm per pixel: an iris is 11.7 mm wide, 46.8 px here (median of 50 in i.csv)" in page


def test_irises_that_are_not_of_one_face_are_not_a_scale(stimuli, close_up, tmp_path):
    table = pd.DataFrame({"left_iris_diameter_px": [46.8] * 9, "right_iris_diameter_px": [4.0] * 9})
    table.to_csv(tmp_path / "i.csv", index=False)
    files = ("--out", tmp_path / "b.csv", "--lids", tmp_path / "l.csv")
    ended = stimuli("blinks", close_up, *files, "--scale", f"iris:{tmp_path / 'i.csv'}")
    assert ended.code == 2
    assert "the irises of both eyes are 4 and 46.8 px wide" in ended.err


def test_a_scale_that_no_eye_has_is_doubted_on_screen_and_in_the_report(stimuli, close_up, tmp_path):
    files = ("--out", tmp_path / "b.csv", "--report", tmp_path / "r.html")
    ended = stimuli("blinks", close_up, *files, "--scale", "2.5")
    assert ended.code == 0, ended.err
    doubt = "mm apart when open, but usual values are 3 to 16"
    assert doubt in ended.err
    assert doubt in (tmp_path / "r.html").read_text(encoding="utf-8").replace("&#39;", "'")
    assert "apart when open" not in stimuli("blinks", close_up, *files, "--scale", "0.25").err


def test_the_table_of_irises_is_not_written_over(stimuli, close_up, tmp_path):
    table = tmp_path / "i.csv"
    pd.DataFrame({"frame": range(9), "iris_diameter_px": [46.8] * 9}).to_csv(table, index=False)
    before = table.read_bytes()
    ended = stimuli(
        "blinks", close_up, "--out", tmp_path / "b.csv", "--lids", table, "--scale", f"iris:{table}"
    )
    assert ended.code == 2
    assert "already used in this call" in ended.err
    assert table.read_bytes() == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("frame,iris_diameter_px\n0,\n1,46\n", "with 5 irises or more, got 1"),
        ("frame,a\n0,1\n", "with 5 irises or more, got 0"),
        (None, "expected a table as CSV, Excel (.xlsx), SPSS (.sav) or JSON"),
    ],
)
def test_a_table_without_irises_is_not_a_scale(stimuli, close_up, tmp_path, content, message):
    if content is not None:
        (tmp_path / "i.csv").write_text(content, encoding="utf-8")
    files = ("--out", tmp_path / "b.csv", "--lids", tmp_path / "l.csv")
    ended = stimuli("blinks", close_up, *files, "--scale", f"iris:{tmp_path / 'i.csv'}")
    assert ended.code == 2
    assert message in ended.err
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize(
    ("format_name", "ending", "read"),
    [("json", ".json", json.loads), ("usd", ".usda", str), ("gltf", ".gltf", json.loads)],
)
def test_the_recording_is_exported_as_a_curve(labelled, tmp_path, make_known, format_name, ending, read):
    ended = labelled("--curve", tmp_path / f"c{ending}", "--curve-format", format_name)
    assert ended.code == 0, ended.err
    content = read((tmp_path / f"c{ending}").read_text(encoding="utf-8"))
    if format_name == "json":
        known = make_known(noise=0.05)
        assert len(content["closure_left"]) == known.distance.size
        assert content["closure_left"][known.minima[0]] == pytest.approx(1, abs=0.03)
        assert content["closure_right"][known.minima[1]] == pytest.approx(0.5 / 0.95, abs=0.06)


def test_an_eye_that_does_not_blink_stays_open_in_the_curve(stimuli, series_file, tmp_path):
    table = pd.read_csv(series_file)
    table["gap_r"] = 30.0
    table.to_csv(tmp_path / "s.csv", index=False)
    ended = stimuli(
        "blinks", tmp_path / "s.csv", "--column", "gap_l", "--column", "gap_r", "--fps", 300,
        "--out", tmp_path / "b.csv", "--curve", tmp_path / "c.json", "--curve-format", "json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    content = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert max(content["closure_left"]) > 0.9
    assert set(content["closure_right"]) == {0.0}


def track(columns=("x", "y"), shift=70.0):
    """Table of two eyes 28 px wide whose middles are `shift` px apart."""
    eye = np.array([[0, 0], [5, -4], [11, -6], [17, -6], [23, -4], [28, 0], [21, 3], [14, 4], [7, 3]], float)
    points = np.concatenate([eye, eye + np.array([shift, 0])])
    return pd.DataFrame(
        {f"{a}{n + 1:02d}": [points[n, k]] * 5 for n in range(18) for k, a in enumerate(columns)}
    )


def test_scales_say_what_they_suppose(tmp_path):
    scale = scale_of(track(), "inter-ocular", tmp_path)
    assert scale.mm_per_px == pytest.approx(INTER_OCULAR_MM / 70)
    assert "60 mm" in scale.rule
    assert scale_of(track(), "eye-width", tmp_path).mm_per_px == pytest.approx(28.2 / 28)
    assert scale_of(track(), "0.25", tmp_path).mm_per_px == 0.25
    assert scale_of(track(), None, tmp_path) is None


@pytest.mark.parametrize(
    ("wanted", "message"),
    [("inter-oclar", "did you mean 'inter-ocular'"), ("-1", "above 0"), ("nan", "above 0")],
)
def test_a_scale_nobody_knows_is_refused(tmp_path, wanted, message):
    with pytest.raises(InputError, match=message):
        scale_of(track(), wanted, tmp_path)


def test_a_chord_of_the_eyeball_is_its_angle():
    assert lid_degrees(np.array([0.0, 12.0, 24.0])) == pytest.approx([0, 60, 180])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            ("--curve", "c.x", "--curve-format", "mya"),
            "unknown --curve-format 'mya'; expected one of: csv, json",
        ),
        (("--curve", "c.fbx", "--curve-format", "fbx"), "unknown --curve-format 'fbx'; expected one of: csv"),
        (
            ("--curve", "c.usd"),
            "--curve c.usd: --curve-format csv is written as .csv or .txt; add --curve-format usd",
        ),
        (("--curve", "c"), "--curve: expected a name that ends in .csv or .txt, got 'c'"),
        (("--report", "r.html", "--scale", "inter-ocular"), "needs a track of both eyes"),
        (("--lids", "l.csv", "--scale", "0.5"), "is in another unit"),
        (("--report", "b.csv"), "a unique name"),
    ],
)
def test_bad_input_leaves_nothing(labelled, monkeypatch, tmp_path, more, message):
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.iterdir())
    ended = labelled(*[tmp_path / "b.csv" if word == "b.csv" else word for word in more])
    assert ended.code == 2
    assert message in ended.err
    assert ended.err.count("\n") == 1
    assert set(tmp_path.iterdir()) == before
