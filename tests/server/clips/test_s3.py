"""The object store against a real S3 protocol server (moto's), through the application."""

import hashlib
import io
from collections.abc import Iterator

import httpx2 as httpx
import pytest
from fastapi.testclient import TestClient

from experiments.errors import InputError
from server.app import create_app
from server.context import open_services
from server.core.settings import Settings
from server.core.storage import S3Store, open_s3
from tests.helpers.studies import add_study

moto_server = pytest.importorskip("moto.server", reason="moto is not installed")
CONTENT = bytes(range(256)) * 9000  # more than two pieces
SHA256 = hashlib.sha256(CONTENT).hexdigest()

pytestmark = [
    # boto3 announces the end of its support for this Python; requirements say 3.11.
    pytest.mark.filterwarnings("ignore::boto3.exceptions.PythonDeprecationWarning"),
    pytest.mark.filterwarnings("ignore:datetime.datetime.utcnow:DeprecationWarning"),
]


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    server = moto_server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def s3_settings(settings: Settings, endpoint: str, monkeypatch: pytest.MonkeyPatch) -> Settings:
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    changes = {"s3_bucket": "clips", "s3_prefix": "/study clips/", "s3_endpoint": endpoint}
    return settings.model_copy(update=changes)


@pytest.fixture
def store(s3_settings: Settings, endpoint: str) -> Iterator[S3Store]:
    httpx.post(f"{endpoint}/moto-api/reset")
    opened = open_s3(s3_settings)
    opened.client.create_bucket(Bucket="clips")
    yield opened
    opened.client.close()


def test_a_clip_is_stored_once_and_read_in_parts(store: S3Store) -> None:
    assert store.size(SHA256) is None
    assert store.add(io.BytesIO(CONTENT), SHA256)
    assert not store.add(io.BytesIO(CONTENT), SHA256)
    assert store.size(SHA256) == len(CONTENT)
    assert b"".join(store.read(SHA256, 0, len(CONTENT))) == CONTENT
    assert b"".join(store.read(SHA256, 100, 300)) == CONTENT[100:300]
    assert b"".join(store.read(SHA256, 5, 5)) == b""
    head = store.client.head_object(Bucket="clips", Key=f"study clips/{SHA256}.mp4")
    assert (head["ContentType"], head["CacheControl"]) == ("video/mp4", "public, max-age=31536000, immutable")
    store.remove(SHA256)
    store.remove(SHA256)
    assert store.size(SHA256) is None


def test_a_clip_with_another_hash_is_refused_and_leaves_nothing(store: S3Store) -> None:
    with pytest.raises(InputError, match="expected sha256"):
        store.add(io.BytesIO(b"other"), SHA256)
    assert "Contents" not in store.client.list_objects_v2(Bucket="clips")


def test_the_server_passes_clips_on_as_from_a_folder(store: S3Store, s3_settings: Settings) -> None:
    store.add(io.BytesIO(CONTENT), SHA256)
    with TestClient(create_app(s3_settings)) as client:
        whole = client.get(f"/clips/{SHA256}.mp4")
        part = client.get(f"/clips/{SHA256}.mp4", headers={"range": "bytes=10-19"})
        missing = client.get(f"/clips/{'0' * 64}.mp4")
    assert (whole.status_code, whole.content) == (200, CONTENT)
    assert whole.headers["etag"] == f'"{SHA256}"'
    assert (part.status_code, part.content) == (206, CONTENT[10:20])
    assert missing.status_code == 404


def test_browsers_may_fetch_from_the_store_itself(
    store: S3Store, s3_settings: Settings, endpoint: str
) -> None:
    store.add(io.BytesIO(CONTENT), SHA256)
    settings = s3_settings.model_copy(update={"s3_presigned": True})
    with TestClient(create_app(settings), follow_redirects=False) as client:
        answer = client.get(f"/clips/{SHA256}.mp4")
    assert answer.status_code == 307
    assert answer.headers["cache-control"] == "private, max-age=1800"
    assert f"connect-src 'self' {endpoint};" in answer.headers["content-security-policy"]
    fetched = httpx.get(answer.headers["location"], headers={"range": "bytes=0-9"})
    assert fetched.content[:10] == CONTENT[:10]
    assert "X-Amz-Signature" in answer.headers["location"]


def test_readiness_asks_the_store(store: S3Store, s3_settings: Settings) -> None:
    study = add_study(open_services(s3_settings), s3_settings.data_folder / "made")
    with TestClient(create_app(s3_settings)) as client:
        assert client.get("/readyz").status_code == 200
        for clip in store.client.list_objects_v2(Bucket="clips")["Contents"]:
            store.client.delete_object(Bucket="clips", Key=clip["Key"])
        answer = client.get("/readyz")
    assert answer.status_code == 503
    assert "bucket clips" in answer.json()["error"]["message"]
    study.services.database.close()


def test_readiness_before_the_first_study_needs_the_bucket_alone(
    store: S3Store, s3_settings: Settings
) -> None:
    with TestClient(create_app(s3_settings)) as client:
        assert client.get("/readyz").status_code == 200
        store.client.delete_bucket(Bucket="clips")
        assert client.get("/readyz").status_code == 503


def test_a_store_that_does_not_answer_is_reported_by_503(s3_settings: Settings) -> None:
    away = s3_settings.model_copy(update={"s3_endpoint": "http://127.0.0.1:1"})
    with TestClient(create_app(away)) as client:
        answer = client.get(f"/clips/{SHA256}.mp4")
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "clips_away")
