"""Damaged SPSS files: the native reader may die of them, the analysis ends in one line or reads them."""

import random
import sys

import pandas as pd
import pyreadstat
import pytest

from analysis.read.long_csv import read_long_table
from experiments.errors import InputError
from table_files import spss

ROWS = [(f"p{i}", cond, 1 + (2 * i + 3 * k) % 7) for i in range(40) for k, cond in enumerate("abc")]
LENGTHS = [b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", b"\0\0\0\x80", b"\0\0\0\0"]


def written(path):
    frame = pd.DataFrame(
        [(p, float("abc".index(c) + 1), float(s)) for p, c, s in ROWS], columns=["id", "cond", "score"]
    )
    words = {"cond": {1: "a", 2: "b", 3: "c"}}
    pyreadstat.write_sav(frame, path, compress=path.suffix == ".zsav", variable_value_labels=words)
    return path


def damaged(data: bytes, seed: int) -> bytes:
    """Bytes changed, the end cut off, or a length made absurd."""
    draw = random.Random(seed)
    content = bytearray(data)
    match seed % 4:
        case 0 | 1 as sort:
            for _ in range(5 if sort else 1):
                content[draw.randrange(len(content))] = draw.randrange(256)
        case 2:
            del content[draw.randrange(len(content)) :]
        case 3:
            at = draw.randrange(len(content) - 4)
            content[at : at + 4] = draw.choice(LENGTHS)
    return bytes(content)


def said_of(path) -> str:
    """The one line; empty where the ratings could be read all the same."""
    try:
        read_long_table(path, "id", "score", ["cond"])
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("name", "seed"),
    [("a.sav", seed) for seed in (89, 289)] + [("a.zsav", seed) for seed in (92, 129, 245, 304)],
)
def test_files_of_which_the_native_reader_died_end_in_one_line(tmp_path, name, seed) -> None:
    path = written(tmp_path / name)
    path.write_bytes(damaged(path.read_bytes(), seed))
    said = said_of(path)
    assert said.startswith(f"{name} is not an SPSS file that can be read (")
    assert said.endswith("export it as CSV")
    assert "\n" not in said


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script replaces Python")
@pytest.mark.parametrize("death", ["kill -SEGV $$", "exit 3", "echo '{'"])
def test_a_reader_that_dies_is_not_an_end_of_the_analysis(tmp_path, monkeypatch, death) -> None:
    path = written(tmp_path / "a.sav")
    stand_in = tmp_path / "python"
    stand_in.write_text(f"#!/bin/sh\n{death}\n", encoding="utf-8")
    stand_in.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stand_in))
    assert "it is damaged: reading it ended the reader" in said_of(path)


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script replaces Python")
def test_a_reader_that_goes_in_circles_is_ended(tmp_path, monkeypatch) -> None:
    path = written(tmp_path / "a.sav")
    stand_in = tmp_path / "python"
    stand_in.write_text("#!/bin/sh\nexec sleep 60\n", encoding="utf-8")
    stand_in.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stand_in))
    monkeypatch.setattr(spss, "SPARE_S", 0.3)
    assert "it is damaged" in said_of(path)


def test_a_folder_with_modules_of_the_users_own_is_not_a_library(tmp_path, monkeypatch) -> None:
    for name in ("analysis", "json", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(7)\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert said_of(written(tmp_path / "a.sav")) == ""
