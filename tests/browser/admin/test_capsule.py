"""A capsule by its button: made, downloaded and deleted, and nothing that the page's policy blocks."""

import io
import zipfile
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.admin.conftest import Dashboard

pytestmark = pytest.mark.browser
LONG_MS = 300_000


def test_a_capsule_is_made_downloaded_and_deleted(dashboard: Dashboard) -> None:
    dashboard.complaints.clear()
    page = dashboard.open("/studies/short/data")
    page.get_by_role("switch", name="with mixed and ordinal models").press("Space")
    page.get_by_role("button", name="Create capsule").click()
    kept = page.get_by_role("status", name="Capsules")
    download = kept.get_by_role("link", name="Download").first
    expect(download).to_be_visible(timeout=LONG_MS)
    with page.expect_download() as made:
        download.click()
    with zipfile.ZipFile(io.BytesIO(Path(made.value.path()).read_bytes())) as capsule:
        assert {"capsule.json", "ro-crate-metadata.json"} <= set(capsule.namelist())
    assert dashboard.complaints == []
    kept.get_by_role("button", name="Delete").first.click()
    page.get_by_role("dialog").get_by_role("button", name="Delete the capsule").click()
    expect(page.get_by_text("Capsule deleted")).to_be_visible()
    assert dashboard.complaints == []
