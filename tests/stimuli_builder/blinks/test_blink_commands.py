import json
import re
from pathlib import Path

import pandas as pd
import pytest

from stimuli_builder.blinks.labelling import PRESETS
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import TABLE_COLUMNS, read_profile_table
from stimuli_builder.blinks.tables import BLINK_COLUMNS

GUIDE = (Path(__file__).parents[3] / "docs" / "explanation" / "blinks.md").read_text(encoding="utf-8")


def test_blinks_of_both_eyes_are_written_with_their_profiles(stimuli, series_file, tmp_path):
    both = ("--column", "gap_l", "--column", "gap_r", "--fps", 300, "--out", tmp_path / "b.csv")
    figures = ("--plot", tmp_path / "s.png", "--plot-aligned", tmp_path / "a.svg")
    ended = stimuli("blinks", series_file, *both, *figures, "--summary", tmp_path / "s.json")
    assert ended.code == 0, ended.err
    table = pd.read_csv(tmp_path / "b.csv")
    assert list(table.columns) == list(BLINK_COLUMNS)
    assert table["column"].tolist() == ["gap_l"] * 4 + ["gap_r"] * 4
    assert table["complete"].tolist()[:4] == [True, False, False, True]
    profiles = read_profile_table(tmp_path / "b.profiles.csv")
    assert [p.eye for p in profiles] == ["left"] * 4 + ["right"] * 4 + ["both"] * 4
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (tmp_path / "a.svg").read_bytes()[:1000]


def test_the_summary_shows_rate_spread_and_histograms(stimuli, series_file, tmp_path):
    arguments = (
        "--column",
        "gap_l",
        "--fps",
        300,
        "--out",
        tmp_path / "b.csv",
        "--summary",
        tmp_path / "s.json",
    )
    assert stimuli("blinks", series_file, *arguments).code == 0
    (summary,) = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))["columns"]
    assert summary["blinks"] == 4
    assert summary["rate_per_minute"] == pytest.approx(24, rel=0.01)
    assert summary["complete"] == 2
    assert summary["interval_s"]["median"] == pytest.approx(2.0, abs=0.02)
    assert sum(summary["duration_histogram"]["counts"]) == 4
    assert sum(summary["amplitude_histogram"]["counts"]) == 4
    assert max(summary["mean_blink"]["closure"]) > 0.8


def test_few_blinks_do_not_show_how_far_lids_close(stimuli, series_file, tmp_path):
    pd.read_csv(series_file).head(1000).to_csv(tmp_path / "short.csv", index=False)
    command = (
        "blinks",
        tmp_path / "short.csv",
        "--column",
        "gap_l",
        "--fps",
        300,
        "--out",
        tmp_path / "b.csv",
    )
    said = "gap_l: there are too few blinks to decide which are complete"
    assert said in " ".join(stimuli(*command).out.split())
    assert said not in " ".join(stimuli(*command, "--closed", 2).out.split())


def test_a_real_series_from_the_command_line(stimuli, shared_data, tmp_path):
    series = shared_data / "blink_series" / "espbm_sample_ear_short.csv"
    ended = stimuli("blinks", series, "--column", "EAR_l", "--fps", 240, "--out", tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    assert len(pd.read_csv(tmp_path / "b.csv")) == 9
    assert len(read_profile_table(tmp_path / "b.profiles.csv")) == 9


def test_a_rejected_blink_is_kept_with_the_reason_and_left_out_of_the_profiles(
    stimuli, series_file, tmp_path
):
    common = ("blinks", series_file, "--column", "gap_l", "--fps", 300, "--out", tmp_path / "b.csv")
    review = ("--review", tmp_path / "review.csv")
    assert stimuli(*common, *review, "--reject", "2=talking").code == 0
    table = pd.read_csv(tmp_path / "b.csv", keep_default_na=False)
    assert table["accepted"].tolist() == [True, False, True, True]
    assert table["reason"].tolist() == ["", "talking", "", ""]
    assert len(read_profile_table(tmp_path / "b.profiles.csv")) == 3
    assert stimuli(*common, *review).code == 0
    assert not pd.read_csv(tmp_path / "b.csv")["accepted"][1]
    assert stimuli(*common, *review, "--accept", "2=only a smile").code == 0
    assert pd.read_csv(tmp_path / "b.csv")["accepted"].all()
    decisions = pd.read_csv(tmp_path / "review.csv")
    assert decisions[["decision", "reason"]].to_numpy().tolist() == [["accept", "only a smile"]]


def test_a_decision_about_a_blink_that_is_gone_is_reported_and_kept(stimuli, series_file, tmp_path):
    review = tmp_path / "review.csv"
    review.write_text("column,minimum_frame,decision,reason\ngap_l,77,reject,old\n", encoding="utf-8")
    common = ("--column", "gap_l", "--fps", 300, "--out", tmp_path / "b.csv", "--review", review)
    ended = stimuli("blinks", series_file, *common)
    assert "frame 77" in ended.out
    assert "gap_l,77,reject,old" in review.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--column", "gap_x"], "did you mean"),
        (["--column", "gap_l", "--fps", "300", "--minimum-depth", "0.5"], "add --preset velocity"),
        (["--column", "gap_l", "--fps", "300", "--resample"], "no column time_s"),
        (["--column", "gap_l", "--fps", "300", "--preset", "papr"], "did you mean 'paper'"),
        (["--column", "gap_l", "--fps", "300", "--reject", "1=x"], "--review"),
        (["--column", "gap_l", "--fps", "300", "--review", "r.csv"], "this review file does not exist"),
        (["--column", "gap_l", "--fps", "300", "--review", "r.csv", "--reject", "9=x"], "has blinks 1 to 4"),
        (["--column", "gap_l", "--fps", "300", "--review", "r.csv", "--reject", "1"], "a reason is missing"),
        (["--column", "gap_l", "--fps", "300", "--review", "r.csv", "--reject", "x=y"], "number of a blink"),
        (
            ["--column", "gap_l", "--column", "gap_r", "--fps", "300", "--review", "r.csv", "--accept", "1"],
            "gap_l:1",
        ),
        (
            ["--column", "gap_l", "--fps", "300", "--report", "r.png"],
            "--report: expected a name that ends in .html or .htm, got 'r.png'",
        ),
        (["--column", "gap_l", "--fps", "300", "--curve", "c.png"], "ends in .csv or .txt"),
        (
            ["--column", "gap_l", "--fps", "300", "--lids", "l.xlsx"],
            "--lids: expected a name that ends in .csv or .txt, got 'l.xlsx'",
        ),
        (["--column", "gap_l", "--fps", "300", "--plot", "figure.gif"], "'gif' is not a figure format"),
        (["--column", "gap_l", "--fps", "300", "--summary", "/dev/null/s.json"], "expected a folder"),
        (["--column", "gap_l", "--fps", "300", "--summary", "b.csv"], "a unique name"),
        (["--column", "gap_l", "--fps", "300", "--closed", "40"], "is not below the opening of any blink"),
        (["--column", "gap_l", "--fps", "300", "--closed", "-1"], "0 or more"),
        (["--column", "gap_l", "--fps", "300", "--complete-from", "2"], "up to 1"),
        (
            [
                "--column",
                "gap_l",
                "--fps",
                "300",
                "--preset",
                "paper",
                "--gradient",
                "0.1",
                "--gradient-px",
                "1",
            ],
            "use only one of",
        ),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    stimuli, series_file, monkeypatch, tmp_path, arguments, message
):
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.iterdir())
    ended = stimuli("blinks", series_file, "--out", "b.csv", *arguments)
    assert ended.code == 2
    assert ended.err.startswith("error: ")
    assert ended.err.count("\n") == 1
    assert message in ended.err
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("fps", [150, 600])
def test_a_rate_that_makes_strange_blinks_is_doubted_not_refused(stimuli, series_file, tmp_path, fps):
    ended = stimuli("blinks", series_file, "--column", "gap_l", "--fps", fps, "--out", tmp_path / "b.csv")
    assert ended.code == 0
    assert ended.err.startswith("warning: at ")
    assert "check --fps" in ended.err


def test_a_model_is_fitted_drawn_from_and_plotted(stimuli, series_file, tmp_path):
    labelled = ("--column", "gap_l", "--column", "gap_r", "--fps", 300, "--out", tmp_path / "b.csv")
    assert stimuli("blinks", series_file, *labelled).code == 0
    fitted = stimuli(
        "model", "fit", tmp_path / "b.profiles.csv", "--out", tmp_path / "m.json",
        "--plot", tmp_path / "m.png",
    )  # fmt: skip
    assert "left and right together" in fitted.out, fitted.err
    arguments = ("--count", 5, "--duration", 9, "--model", tmp_path / "m.json", "--out", tmp_path / "n.csv")
    assert stimuli("model", "sample", *arguments).code == 0
    made = read_profile_table(tmp_path / "n.csv")
    assert [blink.duration_frames_30fps for blink in made] == [9] * 5
    assert all(blink.closure_other is not None for blink in made)


def test_more_samples_leave_the_first_ones_as_they_were(stimuli, tmp_path):
    for count in (2, 4):
        assert stimuli("model", "sample", "--count", count, "--out", tmp_path / f"{count}.csv").code == 0
    text = (tmp_path / "4.csv").read_text(encoding="utf-8")
    assert text.startswith((tmp_path / "2.csv").read_text(encoding="utf-8"))


def test_the_textbook_curves_are_written(stimuli, tmp_path):
    figure = ("--plot", tmp_path / "t.png")
    assert stimuli("model", "textbook", "--duration", 7, "--out", tmp_path / "t.csv", *figure).code == 0
    assert [blink.duration_frames_30fps for blink in read_profile_table(tmp_path / "t.csv")] == [7] * 4


@pytest.mark.parametrize("name", ["csv", "json", "blender", "maya", "arkit"])
def test_every_format_is_exported(stimuli, tmp_path, name):
    source = ("--profile", "espbm-both-03") if name == "maya" else ("--count", 2)
    ended = stimuli("model", "export", "--format", name, *source, "--full-closure", "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    assert (tmp_path / "out").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["export", "--format", "may", "--out", "x"], "did you mean 'maya'"),
        (["export", "--profile", "espbm-left-99", "--out", "x"], "no shipped profile"),
        (
            ["export", "--profile", "espbm-left-01", "--model", "m.json", "--out", "x"],
            "use only one of --profile",
        ),
        (["export", "--left", "a b", "--out", "x"], "expected a name"),
        (["export", "--left", "a", "--right", "a", "--out", "x"], "a separate shape"),
        (["export", "--format", "maya", "--fps", "31", "--out", "x"], "nearest is --fps 30"),
        (["fit", "--eyes", "bth"], "did you mean 'both'"),
        (["fit", "--components", "99"], "allow 1 to"),
        (["fit", "none.csv"], "no file none.csv; expected a table"),
        (["sample", "--duration", "0", "--out", "x.csv"], "a blink lasts"),
        (["sample", "--model", "none.json", "--out", "x.csv"], "cannot be read"),
        (["sample", "--out", "x.csv", "--plot", "x.bmp"], "is not a figure format"),
    ],
)
def test_a_wrong_call_of_model_gets_one_line(stimuli, monkeypatch, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    ended = stimuli("model", *arguments)
    assert ended.code == 2
    assert message in ended.err
    assert ended.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_library_is_listed_and_plotted(stimuli, tmp_path):
    assert f"{len(load_library())} eye profiles" in stimuli("profiles").out
    assert stimuli("profiles", "list").out == stimuli("profiles").out
    assert stimuli("profiles", "plot", tmp_path / "l.pdf").code == 0
    assert (tmp_path / "l.pdf").read_bytes().startswith(b"%PDF")


def test_the_library_is_built_where_asked(stimuli, shared_data, tmp_path):
    ended = stimuli("profiles", "build", "--data", shared_data / "blink_series", "--out", tmp_path)
    assert ended.code == 0, ended.err
    assert {path.name for path in tmp_path.iterdir()} == {"profiles.csv", "closures.csv", "model.json"}


@pytest.mark.parametrize("word", [*BLINK_COLUMNS, *TABLE_COLUMNS, *PRESETS])
def test_every_column_and_preset_is_in_the_guide(word):
    assert f"`{word}`" in GUIDE


@pytest.mark.parametrize(
    "command", ["blinks", "model fit", "model sample", "model textbook", "model export", "profiles build"]
)
def test_every_command_is_in_the_guide_and_has_help(stimuli, command):
    assert f"stimuli {command}" in GUIDE
    assert stimuli(*command.split(), "--help").code == 0


def test_a_review_moves_the_start_and_end_of_a_blink(stimuli, series_file, tmp_path):
    review, out = tmp_path / "review.csv", tmp_path / "b.csv"
    common = ("blinks", series_file, "--column", "gap_l", "--fps", 300, "--out", out)
    assert stimuli(*common).code == 0
    before = pd.read_csv(out)
    onset, minimum, end = (int(before[f"{name}_frame"][1]) for name in ("onset", "minimum", "end"))
    header = "column,minimum_frame,decision,reason,onset_frame,end_frame"
    review.write_text(f"{header}\ngap_l,{minimum + 1},accept,,{onset - 4},{end + 6}\n", encoding="utf-8")
    assert stimuli(*common, "--review", review).code == 0
    after = pd.read_csv(out)
    assert (after["onset_frame"] - before["onset_frame"]).tolist() == [0, -4, 0, 0]
    assert (after["end_frame"] - before["end_frame"]).tolist() == [0, 6, 0, 0]
    assert after["down_frames"][1] == minimum - onset + 4
    longer = len(read_profile_table(tmp_path / "b.profiles.csv")[1].closure)
    assert longer == end - onset + 11

    assert stimuli(*common, "--review", review, "--reject", "2=talking").code == 0
    assert f"gap_l,{minimum},reject,talking,{onset - 4},{end + 6}" in review.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("gap_l,{minimum},accept,,{minimum},", "expected onset_frame before"),
        ("gap_l,{minimum},accept,,,x", "end_frame must be a whole number"),
        ("gap_l,{minimum},accept,,,{far}", "so that they overlap"),
        ("gap_l,{last},accept,,,99999", "the last is"),
    ],
)
def test_moved_ends_that_cannot_be(stimuli, series_file, tmp_path, row, words):
    review, out = tmp_path / "review.csv", tmp_path / "b.csv"
    common = ("blinks", series_file, "--column", "gap_l", "--fps", 300, "--out", out)
    assert stimuli(*common).code == 0
    table = pd.read_csv(out)
    line = row.format(
        minimum=table["minimum_frame"][1],
        far=table["minimum_frame"][2] + 1,
        last=table["minimum_frame"][3],
    )
    header = "column,minimum_frame,decision,reason,onset_frame,end_frame"
    review.write_text(f"{header}\n{line}\n", encoding="utf-8")
    ended = stimuli(*common, "--review", review)
    assert ended.code == 2
    assert words in ended.err


def test_a_blink_that_a_gap_cuts_is_reported_by_its_frame_and_not_as_too_shallow(
    stimuli, series_file, tmp_path
):
    table = pd.read_csv(series_file)
    lowest = int(table["gap_l"].iloc[: len(table) // 4].idxmin())
    table.loc[lowest + 8 :, "gap_l"] = None
    table.to_csv(series_file, index=False)
    out = tmp_path / "b.csv"
    ended = stimuli("blinks", series_file, "--column", "gap_l", "--fps", 300, "--out", out, "--allow-gaps")
    assert (ended.code, ended.err.count("\n")) == (0, 1)
    told = re.search(r"1 dip could not be measured; the first is at frame (\d+): its start or end", ended.err)
    assert told
    assert abs(int(told[1]) - lowest) < 8
    assert "deepest dip" not in ended.err
    assert len(pd.read_csv(out)) == 0


def test_long_names_leave_the_figures_their_width(stimuli, series_file, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    name = "participant_12_session_3_eye_aspect_ratio_of_the_left_eye_smoothed_left"
    pd.read_csv(series_file).rename(columns={"gap_l": name}).to_csv(tmp_path / "s.csv", index=False)
    ended = stimuli("blinks", tmp_path / "s.csv", "--column", name, "--fps", 300, "--out", tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    (row,) = [line for line in ended.out.splitlines() if line.strip().startswith("particip…")]
    assert row.split() == ["particip…hed_left", *row.split()[1:]]
    assert len(row.split()) == 9
    assert "…" not in "".join(row.split()[1:])
