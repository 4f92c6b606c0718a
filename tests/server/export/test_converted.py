from pathlib import Path

import pyreadstat
import pytest
from fastparquet import ParquetFile

from tests.helpers.admins import Admin
from tests.helpers.studies import Participant


def saved(admin: Admin, file: str, folder: Path) -> Path:
    answer = admin.get(f"/studies/short/data/{file}")
    assert answer.status_code == 200, answer.text
    (folder / file).write_bytes(answer.content)
    return folder / file


def test_spss_and_parquet_hold_the_tables(viewer: Admin, participant: Participant, tmp_path: Path) -> None:
    participant.agree()
    participant.request("PUT", "/forms/about", {"answers": {"age": 33, "glasses": ["lenses"]}})
    participant.rate_all()
    frame, about = pyreadstat.read_sav(saved(viewer, "wide.sav", tmp_path))
    assert about.variable_value_labels["form_about_glasses_lenses"] == {0.0: "not chosen", 1.0: "chosen"}
    assert about.column_names_to_labels["form_about_age"] == "Age"
    assert frame.loc[0, ["form_about_age", "form_about_glasses_lenses"]].tolist() == [33, 1]
    assert frame["rating_a_slow"].between(1, 7).all()
    with saved(viewer, "ratings.parquet", tmp_path).open("rb") as stream:
        parquet = ParquetFile(stream).to_pandas()
    assert len(parquet) == 12
    assert list(parquet["speed"].cat.categories) == ["slow", "fast"]
    assert parquet["response"].dropna().between(1, 7).all()


@pytest.mark.parametrize("file", ["wide.xls", "runs.sav"])
def test_there_is_no_other_table(viewer: Admin, participant: Participant, file: str) -> None:
    assert viewer.get(f"/studies/short/data/{file}").status_code in (404, 422)
