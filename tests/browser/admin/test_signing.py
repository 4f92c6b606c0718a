"""Owners read the secret that signs addresses: of the study's recruiter, and of a link's own."""

import hashlib
import hmac
import json

import pytest
from playwright.sync_api import Locator, expect

from tests.browser.admin.conftest import Dashboard

pytestmark = pytest.mark.browser
SIGNED = {"kind": "generic", "id_parameter": "who", "signature_parameter": "sig"}


def declare(dashboard: Dashboard, table: str, secret_name: str) -> None:
    recruiter = json.dumps(SIGNED | {"secret_name": secret_name})
    dashboard.server.change(f"UPDATE {table} SET recruiter = '{recruiter}'".replace(":", "\\:"))


def shown(dashboard: Dashboard, button: Locator) -> str:
    """The secret that the dialog behind this button shows, once its example was found to be signed by it."""
    button.click()
    dialog = dashboard.page.get_by_role("dialog", name="Signed URLs")
    expect(dialog.get_by_text("In Python:")).to_be_visible()
    secret = dialog.locator("pre").first.inner_text().strip()
    signature = hmac.new(bytes.fromhex(secret), b"P-0001", hashlib.sha256).hexdigest()
    expect(dialog.locator("pre").nth(1)).to_contain_text(f"sig={signature}")
    dialog.get_by_role("button", name="Close").click()
    expect(dialog).to_be_hidden()
    return secret


def test_owners_are_shown_the_secret_of_the_study_and_of_a_link(dashboard: Dashboard) -> None:
    button = dashboard.page.get_by_role("button", name="Show signing secret")
    dashboard.open("/studies/short/links").get_by_role("button", name="Withdraw").first.wait_for()
    expect(button).to_have_count(0)
    declare(dashboard, "links", "2")
    dashboard.open("/studies/short/links")
    of_link = shown(dashboard, button)
    recruitment = "/studies/short/settings?part=recruitment"
    expect(dashboard.open(recruitment).get_by_role("heading", name="Recruitment")).to_be_visible()
    expect(button).to_have_count(0)
    declare(dashboard, "studies", "1")
    dashboard.open(recruitment)
    assert shown(dashboard, button) != of_link
