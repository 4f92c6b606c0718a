"""Blinks from files of closure samples."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import write_profile_table
from stimuli_builder.clips.exemplars import read_closure_file, reading_note


def test_one_blink_with_named_columns(tmp_path: Path) -> None:
    file = tmp_path / "blink.csv"
    file.write_text("closure,closure_other\n0,0\n0.5,0.4\n1,0.9\n0.5,0.5\n0,0\n")
    (profile,) = read_closure_file(file)
    assert profile.minimum_index == 2
    assert profile.profile_id == "file-blink"
    np.testing.assert_array_equal(profile.closure_other, [0, 0.4, 0.9, 0.5, 0])


def test_numbers_alone_are_closure(tmp_path: Path) -> None:
    file = tmp_path / "plain.csv"
    file.write_text("0\n0.5\n1\n0.4\n0\n")
    np.testing.assert_array_equal(read_closure_file(file)[0].closure, [0, 0.5, 1, 0.4, 0])


def test_blank_lines_at_the_end_are_not_samples(tmp_path: Path) -> None:
    file = tmp_path / "blink.csv"
    file.write_text("closure\n0\n0.5\n1\n0.4\n0\n\n\n")
    np.testing.assert_array_equal(read_closure_file(file)[0].closure, [0, 0.5, 1, 0.4, 0])


def test_a_table_of_profiles_gives_them_all(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    write_profile_table(file, load_library()[:3])
    assert [p.profile_id for p in read_closure_file(file)] == [p.profile_id for p in load_library()[:3]]


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffclosure;closure_other\n0;0\n0,5;0,4\n1;0,9\n0,5;0,5\n0;0\n\n;\n",
        "closure\tclosure_other\n0\t0\n0.5\t0.4\n1\t0.9\n0.5\t0.5\n0\t0\n",
        'closure,closure_other\n0,0\n"0,5","0,4"\n1,"0,9"\n"0,5","0,5"\n0,0\n',
    ],
)
def test_a_blink_as_spreadsheets_write_it(tmp_path: Path, text: str) -> None:
    file = tmp_path / "blink.csv"
    file.write_text(text, encoding="utf-8")
    (profile,) = read_closure_file(file)
    np.testing.assert_array_equal(profile.closure, [0, 0.5, 1, 0.5, 0])
    np.testing.assert_array_equal(profile.closure_other, [0, 0.4, 0.9, 0.5, 0])


@pytest.mark.parametrize("first", ["closure\n0", "closure\n0,0", "0"])
def test_commas_of_one_column_are_decimal(tmp_path: Path, first: str) -> None:
    file = tmp_path / "blink.csv"
    file.write_text(f"{first}\n0,5\n1\n0,4\n0\n")
    np.testing.assert_array_equal(read_closure_file(file)[0].closure, [0, 0.5, 1, 0.4, 0])
    assert reading_note(file).startswith("blink.csv: decimal commas (e.g. '0,")


def test_a_table_of_profiles_with_semicolons(tmp_path: Path) -> None:
    plain, german = tmp_path / "table.csv", tmp_path / "german.csv"
    write_profile_table(plain, load_library()[:3])
    pd.read_csv(plain).to_csv(german, sep=";", decimal=",", index=False)
    for one, other in zip(read_closure_file(plain), read_closure_file(german), strict=True):
        assert one.profile_id == other.profile_id
        np.testing.assert_array_equal(one.closure, other.closure)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("closure\n0\nnan\n1\n0\n", "closure must be a number, sample 2 is 'nan'"),
        ("closure\n0\n0.5\n1\n0.6\nnan\nnan\n", "closure must be a number, sample 5 is 'nan'"),
        ("closure\nFALSE\nTRUE\nFALSE\n", "closure must be a number, sample 1 is 'FALSE'"),
        ("0,0\n0,3\n0,9\n0,2\n", "no column 'closure'"),
        ("closure;other\n0;0\n0,5;0\nx;0\n0;0\n", "closure must be a number, sample 3 is 'x'"),
        ("closure\n0\nx\n1\n0\n", "closure must be a number, sample 2 is 'x'"),
        ("closure\n0\n0.5\n\n1\n0\n", "closure must be a number, sample 3 is missing"),
        ("closure\n0\n1\n", "at least 3 samples of closure, found 2"),
        ("closure\n0\n1,2\n1,2,3\n0\n", "closure must be a number, sample 3 is '1,2,3'"),
        ("closure\n0,1\n1,1\n0,1\n", "between 0 .open. and 1 .closed., sample 2 is 1.1"),
        ("closure,closure_other\n0,0\n0,5,0,4\n1,1\n0,0\n", "line 3 has 4 cells, the header 2"),
        ("closure\n0\n1.3\n0\n", "between 0 .open. and 1 .closed., sample 2 is 1.3"),
        ("closure\n0\n-0.2\n0\n", "sample 2 is -0.2"),
        ("closur\n0\n1\n0\n", "no column 'closure'; did you mean 'closur'"),
        ("run,score\n1,2\n", r"no column 'closure'; expected one blink .* or a table of profiles \(NAME"),
        ("closure\n1\n0.5\n0\n", "must be inside the blink"),
        ("", "bad.csv is empty; expected a table"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, text: str, line: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=line) as caught:
        read_closure_file(file)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.csv"):
        read_closure_file(tmp_path / "nowhere.csv")
