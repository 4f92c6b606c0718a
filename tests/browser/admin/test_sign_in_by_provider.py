"""Signing in with a real OpenID provider in a real browser: its cookies, redirects and content policy."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from server.accounts import workspaces
from server.accounts.identity import OPERATOR
from server.cli_common import migrated_services
from tests.browser.forked_server import ForkedServer
from tests.browser.server_process import ServerProcess
from tests.helpers.providers import SECRET, provider_for

ROLES = [{"workspace": "vision", "role": "experimenter", "claim": "groups", "value": "vision-lab"}]

PATIENCE_MS = 120_000


@pytest.fixture
def server(built_admin: None, tmp_path: Path) -> Iterator[ServerProcess]:
    """A server that knows a provider by two names: one has a rule that lets people in."""
    process = ForkedServer(tmp_path / "data")
    secret = tmp_path / "client secret"
    secret.write_text(SECRET)
    with migrated_services(process.settings) as services, services.database.write() as session:
        workspaces.create(session, "vision", "Vision laboratory", OPERATOR)
    with provider_for(process.address, "uni", "strict", always="ada") as provider:
        process.further["PALPEBRA_PUBLIC_URL"] = process.address
        for name, label in (("UNI", "The University"), ("STRICT", "ORCID")):
            process.further |= {
                f"PALPEBRA_OIDC__{name}__LABEL": label,
                f"PALPEBRA_OIDC__{name}__ISSUER": provider.issuer,
                f"PALPEBRA_OIDC__{name}__CLIENT_ID": "palpebra",
                f"PALPEBRA_OIDC__{name}__CLIENT_SECRET_FILE": str(secret),
            }
        process.further["PALPEBRA_OIDC__UNI__ROLES"] = json.dumps(ROLES)
        yield process.start()
        process.stop()


def test_a_person_signs_in_by_her_university_and_sees_who_she_is(server: ServerProcess, page: Page) -> None:
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.goto(f"{server.address}/admin/account")
    page.get_by_role("button", name="Sign in with ORCID").click()
    page.get_by_text("No account here uses that login").wait_for(timeout=PATIENCE_MS)
    page.goto(f"{server.address}/admin/account")
    page.get_by_role("button", name="Sign in with The University").click()
    page.get_by_role("heading", name="My account").wait_for(timeout=PATIENCE_MS)
    page.get_by_text("Ada Lovelace").first.wait_for(timeout=PATIENCE_MS)
    page.get_by_role("heading", name="Other ways to sign in").wait_for(timeout=PATIENCE_MS)
    assert page.url == f"{server.address}/admin/account"
    page.get_by_role("button", name="Add ORCID").click()
    page.get_by_label("Your password").last.fill("what an open browser does not know")
    page.get_by_role("button", name="Go to ORCID").click()
    page.get_by_text("Set up a second factor first").wait_for(timeout=PATIENCE_MS)
    assert [text for text in complaints if "ontent Security Policy" in text] == []
