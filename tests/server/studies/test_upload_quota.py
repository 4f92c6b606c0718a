"""What the uploads of one account may hold together, until they become studies or a day is over."""

from pathlib import Path

import pytest

from server.context import Services
from server.studies import uploads
from server.studies.uploaded_file import UploadTooLarge
from tests.helpers.admins import Admin

FILE = {"files": ("clips.csv", b"file\n" * 300, "text/csv")}


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_an_account_that_holds_too_much_sends_no_more(
    services: Services, experimenter: Admin, owner: Admin
) -> None:
    services.settings.max_uploads_bytes = 2000
    first = experimenter.client.post("/api/admin/uploads", files=FILE)
    assert first.status_code == 201
    assert experimenter.client.post("/api/admin/uploads", files=FILE).status_code == 201
    refused = experimenter.client.post("/api/admin/uploads", files=FILE)
    assert refused.status_code == 413
    assert "Make studies of them" in refused.json()["error"]["message"]
    more = {"files": ("more.csv", b"file\n", "text/csv")}
    path = f"/api/admin/uploads/{first.json()['id']}/files"
    assert experimenter.client.post(path, files=more).status_code == 413
    assert owner.client.post("/api/admin/uploads", files=FILE).status_code == 201


def test_an_account_has_no_more_than_so_many_uploads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "MAX_UPLOADS", 3)
    made = [uploads.new_upload(tmp_path, 1)[1] for _ in range(3)]
    with pytest.raises(UploadTooLarge):
        uploads.new_upload(tmp_path, 1)
    uploads.check_quota(tmp_path, 1, 10**9, further=0)
    uploads.new_upload(tmp_path, 2)
    uploads.discard(made[0])
    uploads.new_upload(tmp_path, 1)
