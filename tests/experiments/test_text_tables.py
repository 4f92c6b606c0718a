"""One way to read text tables: any Unicode encoding, line end and separator, in every program."""

from pathlib import Path

import pandas as pd
import pytest

from analysis.read.text_table import read_text_table
from experiments.errors import InputError
from experiments.text_tables import separator_of, utf8_stream
from stimuli_builder.blinks.csv_table import read_table

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be")
ROWS = pd.DataFrame(
    {"id": ["p1", "p2", "p3"], "Lidöffnung": [1.5, 2.25, 3.0], "note": ["größer", "睡眠", "plain"]}
)


def written(path: Path, encoding: str, separator: str = ",", line_end: str = "\n") -> Path:
    text = ROWS.to_csv(index=False, sep=separator, lineterminator=line_end)
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_every_program_reads_every_encoding(
    tmp_path: Path, encoding: str, separator: str, line_end: str
) -> None:
    path = written(tmp_path / "t.csv", encoding, separator, line_end)
    with utf8_stream(path) as stream:
        assert stream.read().decode("utf-8-sig").startswith("id" + separator)
    by_stimuli = read_table(path)
    assert list(by_stimuli.columns) == list(ROWS.columns)
    assert by_stimuli["note"].to_list() == ROWS["note"].to_list()
    assert by_stimuli["Lidöffnung"].to_numpy() == pytest.approx(ROWS["Lidöffnung"].to_numpy())
    by_analysis = read_text_table(path, None)
    assert list(by_analysis.header) == list(ROWS.columns)
    assert [str(note) for note in by_analysis.columns["note"]] == ROWS["note"].to_list()


@pytest.mark.parametrize("read", [read_table, lambda path: read_text_table(path, None)])
@pytest.mark.parametrize("content", [b"\x00\x01\x02\x03" * 100, b"PK\x03\x04\x00\x00\x08\x00" * 40])
def test_every_program_refuses_bytes_that_are_no_text_in_one_line(
    read, content: bytes, tmp_path: Path
) -> None:
    (tmp_path / "t.csv").write_bytes(content)
    with pytest.raises(InputError) as caught:
        read(tmp_path / "t.csv")
    assert "\n" not in str(caught.value)
    assert "t.csv" in str(caught.value)


def test_a_separator_within_quotes_does_not_count() -> None:
    assert separator_of('"a;b;c;d",x') == ","
    assert separator_of("a\tb") == "\t"
    assert separator_of("a;b,c;d") == ";"
