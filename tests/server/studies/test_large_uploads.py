"""Uploads of two gigabytes and more are refused before they are stored, in words that say what would do."""

import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import pytest

from experiments.capsule import CapsuleError, open_capsule
from server.context import Services
from server.studies import uploads
from tests.helpers.admins import Admin

pytestmark = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
PIECE = b"0" * (1 << 20)


def test_a_request_that_says_it_is_too_large_is_not_read(services: Services, experimenter: Admin) -> None:

    size = services.settings.max_upload_bytes + 1
    answer = experimenter.client.post(
        "/api/admin/uploads",
        content=iter([PIECE]),
        headers={"content-length": str(size), "content-type": "multipart/form-data; boundary=x"},
    )
    assert (answer.status_code, answer.json()["error"]["code"]) == (413, "too_large")
    assert "the maximum is 2048 MiB" in answer.json()["error"]["message"]
    folder = services.settings.upload_folder
    assert not folder.exists() or list(folder.iterdir()) == []


def test_a_zip_that_unpacks_to_more_than_the_limit_is_refused_unopened(
    services: Services, experimenter: Admin, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "MAX_UNPACKED_BYTES", 2 << 20)
    zipped = io.BytesIO()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_STORED) as archive:
        for number in range(3):
            archive.writestr(f"clip_{number}.mp4", PIECE)
    answer = experimenter.client.post("/api/admin/uploads", files={"files": ("clips.zip", zipped.getvalue())})
    assert (answer.status_code, answer.json()["error"]["code"]) == (413, "too_large")
    assert "unpacks to 3 MiB; the maximum is 2 MiB" in answer.json()["error"]["message"]
    assert list(services.settings.upload_folder.iterdir()) == []


def test_a_zip_that_lies_about_its_sizes_is_stopped_on_the_way(
    services: Services, experimenter: Admin
) -> None:
    zipped = io.BytesIO()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("clip.mp4", PIECE)
    # The directory says 1000 bytes where a mebibyte follows.
    lying = zipped.getvalue().replace(len(PIECE).to_bytes(4, "little"), (1000).to_bytes(4, "little"))
    answer = experimenter.client.post("/api/admin/uploads", files={"files": ("clips.zip", lying)})
    assert answer.status_code in (413, 422), answer.text
    assert list(services.settings.upload_folder.iterdir()) == []


def test_a_zip_that_names_very_many_files_takes_no_memory(tmp_path: Path, database_url: str) -> None:
    zipped = with_very_many_names(tmp_path / "many.zip")
    tracemalloc.start()
    try:
        with pytest.raises(
            uploads.UploadTooLarge, match="expected at most 8 MiB for the file list of the zip"
        ):
            uploads.unpack(zipped, tmp_path)
        with pytest.raises(CapsuleError, match="expected at most 8 MiB for the file list of the zip"):
            open_capsule(zipped, tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 2 << 20
    finally:
        tracemalloc.stop()


def with_very_many_names(path: Path) -> Path:
    """A zip's end alone: an entry of 47 bytes becomes an object of hundreds, 44 MiB of them took 315 MB."""
    entry = b"PK\x01\x02" + struct.pack("<6H3I5H2I", 20, 20, 0, 0, 0, 33, 0, 0, 0, 1, *[0] * 6) + b"a"
    directory = entry * 200_000
    end = b"PK\x05\x06" + struct.pack("<4H2IH", 0, 0, 0xFFFF, 0xFFFF, len(directory), 0, 0)
    path.write_bytes(directory + end)
    return path
