"""What the uploads of one account may hold together; each is removed after a day."""

import io
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from server.context import Services
from server.studies import uploads
from server.studies.uploads import Quota, UploadTooLarge
from tests.helpers.admins import Admin

FILE = {"files": ("clips.csv", b"file\n" * 300, "text/csv")}
LARGE = 10**9


def held(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_an_account_that_holds_too_much_sends_no_more(
    services: Services, experimenter: Admin, owner: Admin
) -> None:
    services.settings.max_uploads_bytes = 2000
    first = experimenter.client.post("/api/admin/uploads", files=FILE)
    assert first.status_code == 201
    refused = experimenter.client.post("/api/admin/uploads", files=FILE)
    assert refused.status_code == 413
    assert "removed after a day" in refused.json()["error"]["message"]
    path = f"/api/admin/uploads/{first.json()['id']}/files"
    little = {"files": ("more.csv", b"file\n", "text/csv")}
    assert experimenter.client.post(path, files=little).status_code == 200
    more = {"files": ("third.csv", b"file\n" * 100, "text/csv")}
    assert experimenter.client.post(path, files=more).status_code == 413
    assert held(services.settings.upload_folder) <= 2000
    assert owner.client.post("/api/admin/uploads", files=FILE).status_code == 201


def test_a_zip_that_unpacks_to_more_than_there_is_room_for_leaves_nothing(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(3):
            archive.writestr(f"{number}.csv", "file\n" * 300)
    _, folder = uploads.new_upload(Quota(tmp_path, 1, 3000))
    packed.seek(0)
    with pytest.raises(UploadTooLarge, match="removed after a day"):
        uploads.receive(folder, "clips.zip", packed, LARGE, Quota(tmp_path, 1, 3000))
    assert held(tmp_path) < 100
    packed.seek(0)
    uploads.receive(folder, "clips.zip", packed, LARGE, Quota(tmp_path, 1, 6000))
    assert sorted(path.name for path in folder.glob("[!.]*")) == ["0.csv", "1.csv", "2.csv"]


def test_what_comes_at_once_never_holds_more_together(tmp_path: Path) -> None:
    quota = Quota(tmp_path, 1, 4000)
    folders = [uploads.new_upload(quota)[1] for _ in range(6)]
    begun = Barrier(len(folders))

    class Slow(io.BytesIO):
        """Bytes that come only once every upload has seen room."""

        def read(self, size: int | None = -1, /) -> bytes:
            if self.tell() == 0:
                begun.wait(timeout=20)
            return super().read(size)

    def send(number: int) -> bool:
        try:
            uploads.receive(folders[number], "clips.csv", Slow(b"file\n" * 300), LARGE, quota)
        except UploadTooLarge:
            return False
        return True

    with ThreadPoolExecutor(len(folders)) as pool:
        kept = list(pool.map(send, range(len(folders))))
    assert held(tmp_path) <= 4000
    assert sum(kept) == len(list(tmp_path.glob("*/clips.csv")))


def test_files_that_go_while_they_are_counted_are_not_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker's own files, and uploads that become studies, go at any moment."""
    _, folder = uploads.new_upload(Quota(tmp_path, 1, LARGE))
    uploads.receive(folder, "clips.csv", io.BytesIO(b"file\n"), LARGE, Quota(tmp_path, 1, LARGE))
    walk = uploads.os.walk

    def walk_and_lose(path: Path) -> Iterator[tuple[str, list[str], list[str]]]:
        for found in walk(path):
            (folder / "clips.csv").unlink(missing_ok=True)
            yield found

    monkeypatch.setattr(uploads.os, "walk", walk_and_lose)
    assert Quota(tmp_path, 1, LARGE).room() > LARGE - 100


def test_an_account_has_no_more_than_so_many_uploads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "MAX_UPLOADS", 3)
    quota = Quota(tmp_path, 1, LARGE)
    made = [uploads.new_upload(quota)[1] for _ in range(3)]
    with pytest.raises(UploadTooLarge):
        uploads.new_upload(quota)
    assert quota.room() > 0
    uploads.new_upload(Quota(tmp_path, 2, LARGE))
    uploads.discard(made[0])
    uploads.new_upload(quota)
