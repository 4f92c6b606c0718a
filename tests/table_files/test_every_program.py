"""A table that one program reads, all read; what one refuses, all refuse in the same line."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pyreadstat
import pytest

from analysis.cli import main as analysis_main
from experiments.errors import InputError
from experiments.own_clips import levels_from_rows
from stimuli_builder.cli import main as stimuli_main
from table_files.delimited import separator_of
from table_files.open import named_rows

ENCODINGS = (
    *("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be"),
    *("cp1252", "latin-1"),
)
SEPARATORS = {"commas": ",", "semicolons": ";", "tabs": "\t"}
FRAMES = 1200


def recording() -> pd.DataFrame:
    """Three blinks in 10 s, whose frames are also ratings of two people in two conditions."""
    at = np.arange(FRAMES)
    times = at / 120
    return pd.DataFrame(
        {
            "file": [f"clip {frame}.mp4" for frame in at],
            "person": np.where(at % 4 < 2, "Müller", "Núñez"),
            "face": np.where(at % 2 < 1, 'grün, "matt"', "blau"),
            "score": at % 7,
            "time_s": times,
            "Lidöffnung": np.round(10 * (1 - np.exp(-(((times % 3 - 1.5) / 0.06) ** 2))), 4),
        }
    )


TABLE = recording()


@pytest.fixture
def command(monkeypatch, capsys) -> Callable[..., tuple[int, str]]:
    """Call a program; its exit code and what it wrote on stderr."""

    def call(main: Callable[[], object], *arguments: object) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["program", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0), capsys.readouterr().err

    return call


def said_by_all(command, path: Path) -> list[tuple[int, str]]:
    """What is said of a file by `analysis anova`, `stimuli blinks` and the reader of clips' levels."""
    columns = ("--participant", "person", "--rating", "score", "--within", "face")
    said = [
        command(analysis_main, "anova", path, *columns, "--out", path.parent / "report"),
        command(stimuli_main, "blinks", path, "--column", "Lidöffnung", "--out", path.parent / "blinks.csv"),
    ]
    try:
        placed = levels_from_rows(named_rows(path), TABLE["file"])
        assert placed["clip 0.mp4"][0]["face"] == 'grün, "matt"'
        return [*said, (0, "")]
    except InputError as error:
        return [*said, (2, f"error: {error}\n")]


def assert_read(command, path: Path) -> None:
    said = said_by_all(command, path)
    assert [code for code, _ in said] == [0, 0, 0], said
    assert len(pd.read_csv(path.parent / "blinks.csv")) == 3


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("separator", SEPARATORS)
def test_every_encoding_and_separator_is_read_by_all(command, tmp_path, encoding, separator) -> None:
    decimal = "." if separator == "commas" else ","
    text = TABLE.to_csv(index=False, sep=SEPARATORS[separator], decimal=decimal)
    (tmp_path / "t.csv").write_bytes(text.encode(encoding))
    assert_read(command, tmp_path / "t.csv")


DIALECTS: dict[str, Callable[[str], str]] = {
    "CR LF": lambda text: text.replace("\n", "\r\n"),
    "CR alone": lambda text: text.replace("\n", "\r"),
    "no line end at the end": lambda text: text.rstrip("\n"),
    "blank lines": lambda text: "\n" + text.replace("\n", "\n\n", 3),
    "comments above": lambda text: "# made by our laboratory\n% in 2026, by us\n" + text,
    "a blank behind each comma": lambda text: (
        text.replace(",", ", ").replace(', "', ',  "').replace("n, ", "n,")
    ),
    "every row ends in a comma": lambda text: text.replace("\n", ",\n").replace(",\n", "\n", 1),
    "everything in quotes": lambda _: TABLE.to_csv(index=False, quoting=1),
    "a cell of two lines": lambda text: text.replace(",Núñez,", ',"Núñez\n",', 1),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_is_read_by_all(command, tmp_path, dialect) -> None:
    text = DIALECTS[dialect](TABLE.to_csv(index=False))
    (tmp_path / "t.csv").write_text(text, encoding="utf-8", newline="")
    assert_read(command, tmp_path / "t.csv")


def written_as(path: Path) -> Path:
    if path.suffix == ".xlsx":
        book = openpyxl.Workbook()
        for row in [tuple(TABLE.columns), *TABLE.itertuples(index=False, name=None)]:
            book.active.append([cell.item() if isinstance(cell, np.generic) else cell for cell in row])
        book.save(path)
    elif path.suffix == ".sav":
        pyreadstat.write_sav(TABLE, path)
    else:
        path.write_text(TABLE.to_json(orient="records", lines=path.suffix == ".jsonl"), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["t.xlsx", "t.sav", "t.json", "t.jsonl"])
def test_every_sort_of_file_is_read_by_all(command, tmp_path, name) -> None:
    assert_read(command, written_as(tmp_path / name))


PLAIN = TABLE.to_csv(index=False)
REFUSED: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty; expected a table with a header line"),
    "blank lines alone": (b"\n \n", "is empty; expected a table with a header line"),
    "a row too short": (
        PLAIN.replace(",Núñez", "", 1).encode(),
        "line 4 has 5 cells, the header 6; put cells",
    ),
    "a row too long": (
        PLAIN.replace(",Núñez", ",Nú,ñez", 1).encode(),
        "line 4 has 7 cells, the header 6; put",
    ),
    "cut in the midst of a row": (PLAIN[:-30].encode(), "cells, the header 6; put cells"),
    "a quote never closed": (
        PLAIN.replace("Núñez", '"Núñez', 1).encode(),
        "opens a double quote|never closed",
    ),
    "null bytes": (
        b"\x00\x01\x02\x03" * 100,
        "is not UTF-8 text (it holds null bytes); save it as CSV UTF-8",
    ),
    "an unfinished letter": (PLAIN.encode()[:-60] + "ü".encode()[:1], "is not UTF-8 text"),
    "UTF-16 cut off": (
        PLAIN.encode("utf-16")[:-1],
        "is not UTF-16 text (truncated data); save it as CSV UTF-8",
    ),
    "bytes of no letters": (
        b"file,face\n\x81\x8d,a\n",
        "is not UTF-8 text (invalid start byte); save it as CSV",
    ),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_what_one_refuses_all_refuse_in_the_same_line(command, tmp_path, fault) -> None:
    content, expected = REFUSED[fault]
    (tmp_path / "t.csv").write_bytes(content)
    said = said_by_all(command, tmp_path / "t.csv")
    assert [code for code, _ in said] == [2, 2, 2], said
    lines = {message for _, message in said}
    assert len(lines) == 1, lines
    (line,) = lines
    assert line.startswith("error: t.csv")
    assert line.count("\n") == 1
    assert any(part in line for part in expected.split("|"))


@pytest.mark.parametrize("name", ["t.xlsx", "t.sav", "t.json"])
def test_damaged_files_are_refused_by_all_in_the_same_line(command, tmp_path, name) -> None:
    path = written_as(tmp_path / name)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    said = said_by_all(command, path)
    assert [code for code, _ in said] == [2, 2, 2], said
    assert len({message for _, message in said}) == 1, said


def test_other_encodings_than_unicode_are_said_with_a_word(command, tmp_path) -> None:
    (tmp_path / "t.csv").write_bytes(PLAIN.encode("cp1252"))
    _, by_stimuli = said_by_all(command, tmp_path / "t.csv")[1]
    assert "t.csv: read as Windows-1252, since it is not UTF-8 (e.g. 'Lidöffnung')" in by_stimuli
    page = next((tmp_path / "report").glob("*.md")).read_text(encoding="utf-8")
    assert "Read as Windows-1252, since it is not UTF-8 (e.g. 'Lidöffnung')" in page


def test_a_damaged_byte_does_not_make_other_letters_of_the_rest(tmp_path) -> None:
    data = bytearray(PLAIN.encode())
    data[data.rindex("ñ".encode())] = 0xFF
    (tmp_path / "t.csv").write_bytes(bytes(data))
    with pytest.raises(InputError, match=r"t\.csv is not UTF-8 text \(invalid start byte\)"):
        named_rows(tmp_path / "t.csv")


def test_a_separator_within_quotes_does_not_count() -> None:
    assert separator_of('"a;b;c;d",x') == ","
    assert separator_of("a\tb") == "\t"
    assert separator_of("a;b,c;d") == ";"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        (
            "clip.mp4",
            b"\x00\x00\x00 ftypisom" * 9,
            "'clip.mp4' is not a table; expected a file ending in .csv,",
        ),
        (
            "page.pdf",
            b"%PDF-1.7\n%\xb5\x81\x8d\n",
            "'page.pdf' is not a table; expected a file ending in .csv,",
        ),
        ("book.xlsx", b"", "book.xlsx is empty; expected a table with a header line"),
        ("data.json", b"", "data.json is empty; expected a table with a header line"),
    ],
)
def test_a_file_that_is_no_table_is_called_so(tmp_path, name, content, said) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as refused:
        named_rows(tmp_path / name)
    assert str(refused.value).startswith(said)
