"""Clips fetched by the browser itself from an object store (moto's server), by signed URLs.

moto lets every page in, whatever the bucket's CORS rule says; that a rule is needed, and which, is Amazon's
documentation. The browser's own behavior is tested here: the redirect to another origin under our
content security policy and cross-origin isolation.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Response

from server.core.storage import open_s3
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit

moto_server = pytest.importorskip("moto.server", reason="moto is not installed")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.filterwarnings("ignore::boto3.exceptions.PythonDeprecationWarning"),
    pytest.mark.filterwarnings("ignore:datetime.datetime.utcnow:DeprecationWarning"),
]


@pytest.fixture
def store() -> Iterator[str]:
    """The address of a separate store."""
    server = moto_server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def store_server(
    tmp_path: Path, built_page: Path, store: str, monkeypatch: pytest.MonkeyPatch
) -> Iterator[ServerProcess]:
    """A server whose clips are in a separate bucket and are fetched from there."""
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    process = ServerProcess(tmp_path / "data", s3_bucket="browser", s3_endpoint=store, s3_presigned="true")
    client = open_s3(process.settings).client
    client.create_bucket(Bucket="browser")
    rule = {"AllowedMethods": ["GET"], "AllowedHeaders": ["range"], "AllowedOrigins": [process.address]}
    client.put_bucket_cors(Bucket="browser", CORSConfiguration={"CORSRules": [rule]})
    yield process
    process.stop()
    client.close()


def test_a_participant_plays_clips_from_signed_addresses(
    store_server: ServerProcess, store: str, tmp_path: Path, page: Page
) -> None:
    study = store_server.add_study(tmp_path / "clips", PLAIN)
    store_server.start()
    fetched: list[Response] = []
    page.on("response", lambda answer: answer.url.startswith(store) and fetched.append(answer))
    visit = Visit(page, store_server.address).open(study.link_token)
    assert page.evaluate("window.crossOriginIsolated")
    visit.begin().instructions().practice().trials()
    assert visit.problems == []
    assert all(answer.status == 200 and "X-Amz-Signature=" in answer.url for answer in fetched)
    # Six clips of the main part; the practice shows one of them.
    assert len({answer.url.split("?")[0] for answer in fetched}) == 6
    plays = store_server.rows("SELECT method, verdict, frames_missing, drawn FROM trial_ratings")
    assert {play["method"] for play in plays} == {"webcodecs"}
    assert all(json.loads(play["drawn"]) for play in plays)
