from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from server.app import create_app
from server.context import Services
from server.core.settings import Settings
from tests.helpers.studies import StudyInDatabase


@pytest.fixture
def pages(settings: Settings) -> Path:
    for site in ("participant", "admin"):
        folder = settings.frontend_folder / site
        folder.mkdir(parents=True)
        (folder / "index.html").write_text(f"<title>{site}</title>")
        (folder / "page-1a2b.js").write_text("export {}")
    (settings.frontend_folder / "admin" / "index.html").write_text('<meta content="__CSP_NONCE__">')
    (settings.frontend_folder.parent / "secret.txt").write_text("secret")
    return settings.frontend_folder


def test_pages_are_checked_each_time_and_assets_kept(client: TestClient, pages: Path) -> None:
    page = client.get("/run/some-token")
    assert (page.status_code, page.headers["cache-control"]) == (200, "no-cache")
    assert "participant" in page.text
    asset = client.get("/assets/participant/page-1a2b.js")
    assert asset.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert asset.headers["content-type"].startswith("text/javascript")


def test_the_service_worker_is_at_the_root_and_checked_each_time(client: TestClient, pages: Path) -> None:
    assert client.get("/service-worker.js").status_code == 404
    (pages / "participant" / "service-worker.js").write_text("self;")
    worker = client.get("/service-worker.js")
    assert (worker.status_code, worker.text, worker.headers["cache-control"]) == (200, "self;", "no-cache")
    assert worker.headers["content-type"].startswith("text/javascript")


def test_every_admin_address_is_the_admin_page_with_a_nonce_of_its_own(
    client: TestClient, pages: Path
) -> None:
    answers = [client.get(path) for path in ("/admin", "/admin/", "/admin/studies/exp1")]
    nonces = {answer.text.split('"')[1] for answer in answers}
    assert len(nonces) == 3
    for answer in answers:
        assert f"'nonce-{answer.text.split(chr(34))[1]}'" in answer.headers["content-security-policy"]


def test_documentation_that_is_not_built_says_what_to_type(client: TestClient, pages: Path) -> None:
    answer = client.get("/docs/how-to/install.html")
    assert answer.status_code == 503
    assert "<code>make docs</code>" in answer.text
    (pages / "docs").mkdir()
    (pages / "docs" / "index.html").write_text("<title>docs</title>")
    assert client.get("/docs/").status_code == 200
    assert client.get("/docs/how-to/install.html").status_code == 404


def test_the_root_leads_to_the_admin_site(client: TestClient) -> None:
    answer = client.get("/", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (307, "/admin/")


@pytest.mark.parametrize("name", ["../secret.txt", "..%2f..%2fsecret.txt", "%2e%2e/%2e%2e/secret.txt"])
def test_assets_do_not_climb_out(client: TestClient, pages: Path, name: str) -> None:
    assert client.get(f"/assets/participant/{name}").status_code == 404


def test_a_browser_gets_a_page_where_nothing_is_and_a_program_json(client: TestClient) -> None:
    browser = {"accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}
    answer = client.get("/nothing", headers=browser)
    assert (answer.status_code, answer.headers["content-type"]) == (404, "text/html; charset=utf-8")
    assert "Page not found" in answer.text
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    for path, headers in (("/api/nothing", browser), ("/nothing", {}), ("/nothing", {"accept": "*/*"})):
        assert client.get(path, headers=headers).json()["error"]["code"] == "not_found"


def test_pages_that_are_not_built_say_so(client: TestClient) -> None:
    answer = client.get("/run/some-token")
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "pages_not_built")


def test_security_headers_are_on_every_answer(client: TestClient, pages: Path) -> None:
    for path in ("/run/x", "/api/links/x", "/healthz", "/nothing"):
        headers = client.get(path).headers
        policy = headers["content-security-policy"]
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["cross-origin-embedder-policy"] == "require-corp"
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "strict-transport-security" not in headers


def test_behind_https_browsers_are_told_to_stay_there(settings: Settings) -> None:
    secure = settings.model_copy(update={"public_url": "https://lab.example"})
    with TestClient(create_app(secure)) as client:
        assert "max-age=" in client.get("/healthz").headers["strict-transport-security"]


def test_readiness_reports_missing_tables(client: TestClient, settings: Settings, tmp_path: Path) -> None:
    assert client.get("/readyz").json()["status"] == "ready"
    empty = settings.model_copy(update={"database_url": f"sqlite:///{tmp_path / 'empty.sqlite'}"})
    with TestClient(create_app(empty)) as other:
        answer = other.get("/readyz")
    assert answer.status_code == 503
    assert "server database upgrade" in answer.json()["error"]["message"]


def test_readiness_reports_clips_that_cannot_be_read(
    client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    assert client.get("/readyz").status_code == 200
    services.settings.clip_folder.rename(services.settings.data_folder / "unmounted")
    answer = client.get("/readyz")
    assert answer.status_code == 503
    assert "No such file" in answer.json()["error"]["message"]


def test_a_link_answers_who_asks_for_its_head(client: TestClient, study: StudyInDatabase) -> None:
    """Messengers and checkers of links ask so."""
    asked, got = (client.request(method, f"/run/{study.link_token}") for method in ("HEAD", "GET"))
    assert asked.status_code == got.status_code


def test_security_txt_names_who_to_contact_until_when(settings: Settings) -> None:
    named = settings.model_copy(update={"security_contact": "mailto:safe@lab.example"})
    with TestClient(create_app(named)) as client:
        answer = client.get("/.well-known/security.txt")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/plain; charset=utf-8")
    fields = dict(line.split(": ", 1) for line in answer.text.splitlines())
    assert fields["Contact"] == "mailto:safe@lab.example"
    assert fields["Canonical"] == f"{settings.public_url}/.well-known/security.txt"
    until = datetime.fromisoformat(fields["Expires"]) - datetime.now(UTC)
    assert timedelta(days=80) < until < timedelta(days=365)  # RFC 9116: less than a year


def test_without_a_contact_there_is_no_security_txt(client: TestClient) -> None:
    assert client.get("/.well-known/security.txt").status_code == 404


@pytest.mark.parametrize(
    "contact", ["safe@lab.example", "http://lab.example", "mailto:a@b.c\nExpires: never"]
)
def test_other_contacts_are_refused(contact: str) -> None:
    with pytest.raises(ValueError, match=r"expected mailto:name@example\.org or https://"):
        Settings(security_contact=contact)
