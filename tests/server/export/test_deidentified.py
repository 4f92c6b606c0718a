import csv
import io
import zipfile
from datetime import datetime

from tests.helpers.admins import Admin
from tests.helpers.studies import Participant

REMARK = "I am Jane Doe of Example Street"


def test_the_dataset_holds_no_own_words_no_device_and_no_date(
    viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    for trial in participant.state()["trials"]:
        assert participant.rate(trial, comment=REMARK).status_code == 201
    plain = viewer.get("/studies/short/data/ratings.csv").text
    assert REMARK in plain
    with zipfile.ZipFile(io.BytesIO(viewer.get("/studies/short/data/psych-ds.zip").content)) as archive:
        tables = {name: archive.read(name).decode() for name in archive.namelist() if "/data/" in name}
        everything = b"".join(archive.read(name) for name in archive.namelist()).decode()
    assert REMARK not in everything
    [ratings] = [text for name, text in tables.items() if "ratings" in name]
    [runs] = [text for name, text in tables.items() if "runs" in name]
    [run] = csv.DictReader(io.StringIO(runs))
    assert not {"device", "exclusion_reason", "comment"} & set(run)
    assert run["started_at"] == "2000-01-01T00:00:00.000000Z"
    moved = [row["saved_at"] for row in csv.DictReader(io.StringIO(ratings))]
    stored = [row["saved_at"] for row in csv.DictReader(io.StringIO(plain))]
    assert {moment[:4] for moment in moved} == {"2000"}
    assert intervals(moved) == intervals(stored)


def intervals(moments: list[str]) -> list[float]:
    times = [datetime.fromisoformat(moment) for moment in moments]
    return [(after - times[0]).total_seconds() for after in times]
