"""A database that cannot be read is closed: nothing of a refused look stays open."""

import sqlite3
from pathlib import Path

import psutil
import pytest

from analysis.plans.plan import plan_of
from analysis.read.database import load_database
from analysis.read.reading import NoRatingsError
from experiments.errors import InputError
from experiments.load import load_experiment


@pytest.mark.parametrize(
    ("content", "refusal", "message"),
    [("empty", NoRatingsError, "has no view"), ("text", InputError, "cannot read")],
)
def test_a_refused_database_is_not_left_open(
    tmp_path: Path, content: str, refusal: type[Exception], message: str
) -> None:
    file = tmp_path / "palpebra.sqlite"
    if content == "empty":
        sqlite3.connect(file).close()
        file.touch()
    else:
        file.write_text("not a database" * 100)
    declared = load_experiment("exp3")
    with pytest.raises(refusal, match=message) as refused:
        load_database(f"sqlite:///{file}", declared, plan_of(declared.trial.kind).reading)
    # The exception's frames are still there, as in a program that reports it: only closing closes.
    assert refused.value.__traceback__ is not None
    assert [opened.path for opened in psutil.Process().open_files() if opened.path == str(file)] == []
