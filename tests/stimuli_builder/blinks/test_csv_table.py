"""Series as spreadsheets and other programs write them, and files that are none."""

import csv
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.csv_table import NOTE, line_of, read_table, write_table
from stimuli_builder.blinks.series import read_series
from table_files.formulas import guarded_cell


def test_semicolons_and_decimal_commas_are_read_and_said(stimuli, series_file, tmp_path):
    plain = ("--column", "gap_l", "--fps", 300, "--out")
    german = tmp_path / "german.csv"
    pd.read_csv(series_file).to_csv(german, sep=";", decimal=",", index=False)
    assert stimuli("blinks", series_file, *plain, tmp_path / "a.csv").code == 0
    ended = stimuli("blinks", german, *plain, tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    assert "note: german.csv: columns separated by semicolons, decimal commas (e.g. '" in ended.err
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


@pytest.mark.parametrize(
    ("text", "values", "note"),
    [
        ("frame,a\n0,0.5\n1,\n", [0.5, None], None),
        ("frame\ta\n0\t0.5\n1\t0.25\n", [0.5, 0.25], "t.csv: columns separated by tabs"),
        ("\ufefframe;a\n0;0,5\n1;1\n", [0.5, 1], "read as decimal points"),
        ('frame,a\n0,"0,5"\n1,\n', [0.5, None], "t.csv: decimal commas (e.g. '0,5') read"),
        ("frame;a\n0;1,5E-05\n1;-0,5\n", [1.5e-05, -0.5], "read as decimal points"),
        ('"frame; b; c",a\n0,0.5\n1,0.25\n', [0.5, 0.25], None),
        ("frame,a\n0,0.5,\n1,0.25,\n", [0.5, 0.25], None),  # every row ends in a comma
    ],
)
def test_a_table_is_read_by_its_separator(tmp_path, text, values, note):
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    table = read_table(path)
    assert table["a"].astype(object).where(table["a"].notna(), None).tolist() == values
    assert (note or "") in table.attrs.get(NOTE, "")
    assert (NOTE in table.attrs) == (note is not None)


@pytest.mark.parametrize("text", ["a\n10,52\n10,48\n", "frame,a\n0,0,5\n1,0,7\n"])
def test_decimal_commas_among_commas_are_refused(tmp_path, text):
    """The first column would have become an index, and the digits behind the commas the distance."""
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(
        InputError, match=r"line 2 has \d cells, the header \d; .* semicolons where commas are decimal"
    ):
        read_table(path)


def test_thousands_are_not_decimals(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text('frame,a\n0,"1,234"\n1,999\n', encoding="utf-8")
    with pytest.raises(InputError, match="must have numbers"):
        read_series(path, ["a"], 240)


def test_words_next_to_decimal_commas_stay_words(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("frame;a\n0;0,5\n1;lost\n", encoding="utf-8")
    with pytest.raises(InputError, match="must have numbers"):
        read_series(path, ["a"], 240)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (bytes([0x93, 0xFF, 0x00]), r"rub\.csv is not UTF-8 text .*; save it as CSV UTF-8"),
        (b"\0\1", r"rub\.csv is not UTF-8 text .*; save it as CSV UTF-8"),
        (b"", r"rub\.csv is empty; expected"),
        (b"\n \n", r"rub\.csv is empty; expected"),
    ],
)
def test_what_is_not_text_is_refused_by_what_it_is(tmp_path, content, message):
    path = tmp_path / "rub.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_table(path)


def test_a_folder_is_refused_as_one(tmp_path):
    with pytest.raises(InputError, match="expected a CSV file, this is a folder"):
        read_table(tmp_path)


def test_an_unknown_column_is_answered_with_plausible_ones(tmp_path):
    path = tmp_path / "t.csv"
    points = ",".join(f"x{number:02d}" for number in range(1, 58))
    row = ",".join(["0.5"] * 57)
    path.write_text(f"frame,{points},left_distance_px,right_distance_px\n0,{row},3.5,3.5\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_series(path, ["nope"], 240)
    assert str(refused.value).endswith(
        "no column 'nope'; expected one of: left_distance_px, right_distance_px"
    )


def test_many_candidates_are_not_all_listed(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(
        ",".join(f"x{number}" for number in range(50)) + "\n" + ",".join(["0.5"] * 50) + "\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError, match=r"the table has x0, x1, x2, x3, x4, x5 and 44 more$"):
        read_series(path, [], 240)


@pytest.mark.parametrize("more", [(), ("--lids", "lids.csv")])
def test_a_scale_nobody_knows_is_refused_always(stimuli, series_file, monkeypatch, tmp_path, more):
    monkeypatch.chdir(tmp_path)
    call = (
        "blinks",
        series_file,
        "--column",
        "gap_l",
        "--fps",
        300,
        "--out",
        "b.csv",
        "--scale",
        "foo",
        *more,
    )
    ended = stimuli(*call)
    assert ended.code == 2
    assert ended.err == (
        "error: --scale foo: expected a number of mm per pixel, 'inter-ocular', 'eye-width' or "
        "'iris:' and a table of stimuli iris\n"
    )
    assert not (tmp_path / "b.csv").exists()


def test_a_scale_without_effect_is_said(stimuli, series_file, tmp_path):
    call = ("blinks", series_file, "--column", "gap_l", "--fps", 300, "--out", tmp_path / "b.csv")
    ended = stimuli(*call, "--scale", "0.25")
    assert ended.code == 0
    assert ended.err == "note: --scale has no effect here: it applies to --lids and --report\n"


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_blank_lines_are_counted_as_lines(tmp_path, separator):
    lines = [f"{k / 60:.4f}{separator}0.3" for k in range(400)]
    lines[50:50] = ["", "  "]
    lines[102] = lines[102].replace("0.3", "x")
    (tmp_path / "s.csv").write_text("\n".join(["", f"time_s{separator}EAR", *lines]), encoding="utf-8")
    with pytest.raises(InputError, match=r"got .x. in line 105$"):
        read_series(tmp_path / "s.csv", ["EAR"])
    lines[102] = lines[102].replace("x", "0.3")
    for number in range(200, 220):
        lines[number] = lines[number].removesuffix("0.3")
    (tmp_path / "s.csv").write_text("\n".join([f"time_s{separator}EAR", *lines]), encoding="utf-8")
    with pytest.raises(InputError, match="no value for 20 frames from line 202 on"):
        read_series(tmp_path / "s.csv", ["EAR"])
    del lines[300:320]
    (tmp_path / "s.csv").write_text("\n".join([f"time_s{separator}EAR", *lines]), encoding="utf-8")
    with pytest.raises(InputError, match=r"uneven \(line 302\)"):
        read_series(tmp_path / "s.csv", ["EAR"])


def test_a_recording_in_utf_16_is_labelled(stimuli, tmp_path) -> None:
    times = np.arange(1200) / 120
    value = 10 * (1 - np.exp(-(((times % 3 - 1.5) / 0.06) ** 2)))
    text = pd.DataFrame({"time_s": times, "Lidöffnung": value}).to_csv(index=False, sep="\t")
    (tmp_path / "s.txt").write_bytes(text.encode("utf-16"))
    ended = stimuli("blinks", tmp_path / "s.txt", "--out", tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    assert len(pd.read_csv(tmp_path / "b.csv")) == 3


ASC = "** CONVERTED FROM a.edf using edfapi 4.2\n** DATE: Sat Nov 28\nMSG\t1 !MODE\n1234\t500.1\t400.2\n"
DEEPLABCUT = "scorer,net,net,net\nbodyparts,upper,upper,upper\ncoords,x,y,likelihood\n0,1.5,2.5,0.9\n"
TITLED = "Recording of Monday\nName,Value\na,b,c,d,e\n1,2,3,4,5\n"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.asc", ASC, "EyeLink recording"),
        ("a.txt", ASC, "EyeLink recording"),
        ("a.csv", DEEPLABCUT, "DeepLabCut table of points"),
        ("a.csv", TITLED, "line 2 has 2 cells, the header 1; .* delete lines above the header"),
    ],
)
def test_files_of_other_programs_are_refused_by_what_they_are(tmp_path, name, content, said):
    (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_table(tmp_path / name)
    assert "\n" not in str(caught.value)
    for word in ("tokeniz", "pandas", "C error"):
        assert word not in str(caught.value)


@pytest.mark.parametrize("mark", ["#", "%"])
def test_comments_above_the_header_are_skipped_and_lines_counted_with_them(tmp_path, mark):
    path = tmp_path / "a.tsv"
    path.write_text(f"{mark} rate\t60\n{mark}\n\ntime_s\tgap\n0\t1.5\n0.1\t2.5\n", encoding="utf-8")
    table = read_table(path)
    assert list(table.columns) == ["time_s", "gap"]
    assert table["gap"].to_list() == [1.5, 2.5]
    assert line_of(path, 1) == 6
    assert "2 lines of comment" in table.attrs["note"]


@pytest.mark.parametrize("names", ["time,left_ear", "left_ear"])
def test_a_comment_right_above_numbers_names_the_columns(tmp_path: Path, names: str) -> None:
    """As NumPy writes tables: the first row of numbers is not the header."""
    columns = names.split(",")
    values = np.tile(np.arange(5) / 10, (len(columns), 1)).T
    np.savetxt(tmp_path / "t.csv", values, delimiter=",", header=f"a recording\n{names}")
    table = read_table(tmp_path / "t.csv")
    assert (list(table.columns), len(table)) == (columns, 5)
    assert line_of(tmp_path / "t.csv", 0) == 3


@pytest.mark.parametrize("length", [3, 40, 200])
def test_minus_one_is_a_frame_that_was_not_measured(tmp_path, length):
    values = np.linspace(20.0, 21.0, 1200)
    values[500 : 500 + length] = -1
    pd.DataFrame({"time_s": np.arange(1200) / 120, "gap": values}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv")
    assert np.nanmin(series.distance) > 19
    assert any(f"'gap' is -1 on {length} frames" in note for note in series.notes)
    values[100] = -3
    pd.DataFrame({"time_s": np.arange(1200) / 120, "gap": values}).to_csv(tmp_path / "s.csv", index=False)
    with pytest.raises(InputError, match="negative distances"):
        read_series(tmp_path / "s.csv")


@pytest.mark.parametrize("name", ["=1+1", "＝1+1", "@SUM(1)", "-lid", "+lid", "lid;=1+1"])
def test_names_and_texts_do_not_run_in_a_spreadsheet_and_come_back(tmp_path: Path, name: str) -> None:
    table = pd.DataFrame({name: [1.5, -2.5], "reason": [name, ""], "frame": [1, 2]})
    write_table(tmp_path / "t.csv", table)
    written = (tmp_path / "t.csv").read_text(encoding="utf-8")
    header, *rows = csv.reader(written.splitlines())
    assert header == [guarded_cell(name), "reason", "frame"]
    assert rows[0] == ["1.5", guarded_cell(name), "1"]
    assert rows[1][0] == "-2.5"
    read = read_table(tmp_path / "t.csv")
    assert list(read.columns) == list(table.columns)
    assert read["reason"][0] == name
