import json
from pathlib import Path

import pandas as pd
import pyreadstat
import pytest
from fastparquet import ParquetFile
from pydantic import TypeAdapter
from typer.testing import CliRunner

from analysis.cli import app
from analysis.convert import spss_names
from experiments.columns import Column
from experiments.errors import InputError

COLUMNS = [
    Column("run", "text", "Public identifier."),
    Column(
        "speed",
        "text",
        "Level of the factor Speed.",
        values=("slow", "fast"),
        labels=(("slow", "Slow, 1 s"),),
    ),
    Column("age", "integer", "Age | in years", minimum=18),
    Column("effort", "integer", "How hard?", labels=(("1", "leicht"), ("7", "schwer"))),
    Column("größe", "number", "Größe"),
    Column("saved_at", "time", "When it was stored."),
]
TABLE = (
    "run,speed,age,effort,größe,saved_at\n"
    "ä1,fast,30,7,1.5,2026-11-22T01:02:03.500000Z\n"
    '"=1+1",slow,,1,,\n'
    ",,44,2,-2,2026-11-22T01:02:04.000000Z\n"
)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "t.csv").write_text(TABLE, encoding="utf-8")
    (tmp_path / "c.json").write_bytes(TypeAdapter(list[Column]).dump_json(COLUMNS))
    return tmp_path


def convert(folder: Path, out: str):
    arguments = [
        "convert",
        str(folder / "t.csv"),
        "--columns",
        str(folder / "c.json"),
        "--out",
        str(folder / out),
    ]
    return CliRunner().invoke(app, arguments)


def test_spss_has_codes_with_labels_and_real_numbers(files: Path) -> None:
    result = convert(files, "t.sav")
    assert result.exit_code == 0, result.output
    frame, about = pyreadstat.read_sav(files / "t.sav")
    assert list(frame.columns) == ["run", "speed", "age", "effort", "grosse", "saved_at"]
    assert about.column_names_to_labels["grosse"] == "Größe"
    assert about.variable_value_labels["speed"] == {1.0: "Slow, 1 s", 2.0: "fast"}
    assert about.variable_value_labels["effort"] == {1.0: "leicht", 7.0: "schwer"}
    assert frame["speed"].tolist()[:2] == [2.0, 1.0]
    assert frame["run"].tolist() == ["ä1", "=1+1", ""]
    assert frame.isna().sum().to_dict() == {
        "run": 0,
        "speed": 1,
        "age": 1,
        "effort": 0,
        "grosse": 1,
        "saved_at": 1,
    }
    assert frame["saved_at"][0] == pd.Timestamp("2026-11-22T01:02:03.5")  # SPSS has no time zones
    assert about.variable_measure["speed"] == "nominal"


def test_parquet_keeps_types_levels_and_meanings(files: Path) -> None:
    result = convert(files, "t.parquet")
    assert result.exit_code == 0, result.output
    with (files / "t.parquet").open("rb") as stream:
        parquet = ParquetFile(stream)
        frame = parquet.to_pandas()
        assert parquet.key_value_metadata["age"] == "Age | in years"
    assert frame["age"].tolist()[0] == 30
    assert frame["saved_at"][0] == pd.Timestamp("2026-11-22T01:02:03.5Z")
    assert str(frame["effort"].dtype) == "int64"
    assert list(frame["speed"].cat.categories) == ["slow", "fast"]
    assert frame["größe"].tolist()[2] == -2


def test_names_that_spss_cannot_have_are_changed_and_stay_apart() -> None:
    names = spss_names(["with", "Größe", "GROSSE", "1st", "a" * 80, "a" * 81])
    assert names[:4] == ["with_1", "Grosse", "GROSSE_2", "v1st"]
    assert all(len(name.encode()) <= 64 for name in names)
    assert len({name.casefold() for name in names}) == len(names)


def test_another_table_than_declared_is_refused(files: Path) -> None:
    (files / "t.csv").write_text(TABLE.replace("age", "years"), encoding="utf-8")
    result = convert(files, "t.sav")
    assert isinstance(result.exception, InputError)
    assert "expected the declared columns" in str(result.exception)
    (files / "c.json").write_text(json.dumps([{"name": "x"}]))
    assert "expected the JSON file from" in str(convert(files, "t.sav").exception)
    said = str(convert(files, "t.sav").exception)
    assert said.endswith("(column 1: type: this key is required but missing)"), said
    (files / "c.json").write_text("{}")
    assert str(convert(files, "t.sav").exception).endswith("(expected a list, got an empty table)")
    (files / "c.json").write_text("run,speed")
    assert str(convert(files, "t.sav").exception).endswith("(this is not valid JSON)")
    assert "ending in .sav or .parquet" in str(convert(files, "t.xls").exception)
    assert not (files / "t.sav").exists()
