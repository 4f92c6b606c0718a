import hashlib
import io
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.errors import InputError
from server.context import Services
from server.core.storage import FolderStore

CONTENT = bytes(range(256)) * 40
SHA256 = hashlib.sha256(CONTENT).hexdigest()
URL = f"/clips/{SHA256}.mp4"


@pytest.fixture
def clip(services: Services) -> None:
    services.clips.add(io.BytesIO(CONTENT), SHA256)


@pytest.mark.usefixtures("clip")
class TestServing:
    def test_a_whole_clip_may_be_kept_for_ever(self, client: TestClient) -> None:
        answer = client.get(URL)
        assert answer.status_code == 200
        assert answer.content == CONTENT
        assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
        assert answer.headers["etag"] == f'"{SHA256}"'
        assert answer.headers["content-type"] == "video/mp4"
        assert answer.headers["accept-ranges"] == "bytes"

    def test_head_shows_the_length_without_the_bytes(self, client: TestClient) -> None:
        answer = client.head(URL)
        assert (answer.status_code, answer.content) == (200, b"")
        assert answer.headers["content-length"] == str(len(CONTENT))

    @pytest.mark.parametrize(
        ("asked", "start", "end"),
        [
            ("bytes=0-99", 0, 100),
            ("bytes=100-", 100, 10240),
            ("bytes=-5", 10235, 10240),
            ("bytes=10200-99999", 10200, 10240),
        ],
    )
    def test_a_part(self, client: TestClient, asked: str, start: int, end: int) -> None:
        answer = client.get(URL, headers={"range": asked})
        assert answer.status_code == 206
        assert answer.content == CONTENT[start:end]
        assert answer.headers["content-range"] == f"bytes {start}-{end - 1}/{len(CONTENT)}"

    @pytest.mark.parametrize("asked", ["bytes=10240-", "bytes=-0", "bytes=7-3"])
    def test_a_part_outside_is_refused(self, client: TestClient, asked: str) -> None:
        answer = client.get(URL, headers={"range": asked})
        assert answer.status_code == 416
        assert answer.json()["error"]["code"] == "range_not_satisfiable"
        assert answer.headers["content-range"] == f"bytes */{len(CONTENT)}"

    @pytest.mark.parametrize("asked", ["frames=1-2", "bytes=0-1,4-5", "bytes=-"])
    def test_another_kind_of_range_gives_the_whole(self, client: TestClient, asked: str) -> None:
        assert client.get(URL, headers={"range": asked}).status_code == 200

    def test_a_copy_the_browser_has_is_not_sent_again(self, client: TestClient) -> None:
        answer = client.get(URL, headers={"if-none-match": f'"{SHA256}"'})
        assert (answer.status_code, answer.content) == (304, b"")

    def test_a_part_of_another_version_gives_the_whole(self, client: TestClient) -> None:
        answer = client.get(URL, headers={"range": "bytes=0-9", "if-range": '"other"'})
        assert answer.status_code == 200

    def test_an_unknown_clip(self, client: TestClient) -> None:
        answer = client.get(f"/clips/{'0' * 64}.mp4")
        assert (answer.status_code, answer.json()["error"]["code"]) == (404, "clip_unknown")

    @pytest.mark.parametrize("name", ["..%2f..%2fetc%2fpasswd", "ABC", SHA256.upper()])
    def test_a_name_that_is_not_a_hash(self, client: TestClient, name: str) -> None:
        assert client.get(f"/clips/{name}.mp4").status_code in (404, 422)


class Broken(io.BytesIO):
    """A source that fails half way."""

    def read(self, *_: Any) -> bytes:
        raise OSError("the disk was pulled out")


def test_a_clip_with_another_hash_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected sha256"):
        FolderStore(tmp_path).add(io.BytesIO(b"other"), SHA256)
    with pytest.raises(OSError, match="pulled out"):
        FolderStore(tmp_path).add(Broken(), SHA256)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_clip_is_stored_once(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    assert store.size(SHA256) is None
    assert store.add(io.BytesIO(CONTENT), SHA256)
    assert not store.add(io.BytesIO(CONTENT), SHA256)
    assert store.size(SHA256) == len(CONTENT)
    store.remove(SHA256)
    assert store.size(SHA256) is None
