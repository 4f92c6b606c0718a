from pathlib import Path

import pyreadstat
import pytest
from fastparquet import ParquetFile

from server.exports.endpoints import _converting
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


def test_what_cannot_be_converted_is_refused_before_the_file_begins(
    viewer: Admin, participant: Participant, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    participant.agree()
    participant.rate_all()
    # The real program, which finds no place for the file.
    monkeypatch.setattr("server.exports.endpoints.tempfile.mkdtemp", lambda prefix: str(tmp_path / "gone"))
    monkeypatch.setattr("server.exports.endpoints.write_table", lambda table, folder: None)
    answer = viewer.get("/studies/short/data/ratings.sav")
    assert answer.status_code == 422
    assert answer.json()["error"]["message"]
    assert "content-disposition" not in answer.headers
    monkeypatch.undo()
    whole = viewer.get("/studies/short/data/ratings.sav")
    assert (whole.status_code, int(whole.headers["content-length"])) == (200, len(whole.content))
    assert whole.headers["palpebra-rows"] == "12"


def test_one_file_is_converted_at_a_time(viewer: Admin, participant: Participant) -> None:
    participant.agree()
    with _converting:
        busy = viewer.get("/studies/short/data/wide.parquet")
    assert (busy.status_code, "Try again in a moment" in busy.json()["error"]["message"]) == (409, True)
