"""A real OpenID provider under node, and a browser that signs in with it."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx2
import pytest
from fastapi.testclient import TestClient

FRONTEND = Path(__file__).resolve().parents[2] / "frontend"
SCRIPT = FRONTEND / "tests" / "providers" / "provider.mjs"
SECRET = "a secret between the two"
ACCOUNTS = {
    "ada": {"name": "Ada Lovelace", "groups": ["staff", "vision-lab"]},
    "zoe": {"name": "Zoe", "groups": ["students"]},
    "eve": {"name": "the owner", "groups": ["vision-lab"], "email": "owner@lab.example"},
}


@dataclass
class RunningProvider:
    """A provider that listens, for servers at this address."""

    issuer: str
    public_url: str

    def spoil(self, how: str) -> None:
        """Make the next ID token a forged one."""
        answer = httpx2.post(f"{self.issuer}/test/spoil", params={"how": how})
        assert answer.status_code == 204, how

    def logout_token(self, subject: str, how: str | None = None) -> str:
        """What the provider sends to its clients when a subject signs out; forged as said."""
        asked = {"sub": subject} | ({"how": how} if how else {})
        answer = httpx2.post(f"{self.issuer}/test/logout", params=asked)
        assert answer.status_code == 200, answer.text
        return answer.text


@contextmanager
def provider_for(public_url: str, *names: str, always: str | None = None) -> Iterator[RunningProvider]:
    """Run a provider that knows the server at `public_url`; skips where node cannot run it.

    always: who signs in, whatever the browser says.
    """
    if shutil.which("node") is None or not (FRONTEND / "node_modules" / "oidc-provider").is_dir():
        pytest.skip("needs node and frontend/node_modules for npm's oidc-provider")
    clients = [
        {
            "client_id": "palpebra",
            "client_secret": SECRET,
            "redirect_uris": [f"{public_url}/api/admin/session/providers/{name}/callback" for name in names],
        }
    ]
    told = json.dumps({"clients": clients, "accounts": ACCOUNTS} | ({"always": always} if always else {}))
    process = subprocess.Popen(
        ["node", SCRIPT, told], cwd=FRONTEND, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert process.stdout is not None
        line = next((line for line in process.stdout if line.startswith("{")), "")
        assert line, "the provider did not start"
        yield RunningProvider(json.loads(line)["issuer"], public_url)
    finally:
        process.kill()
        process.communicate()


@dataclass
class Visitor:
    """A browser: its cookies with our server and with the provider."""

    browser: TestClient
    cookies: httpx2.Cookies = field(default_factory=httpx2.Cookies)

    def begin(self, provider: str = "uni", next_page: str = "/") -> str:
        """Ask to sign in; the address at the provider."""
        answer = self.browser.post(f"/api/admin/session/providers/{provider}", json={"next": next_page})
        assert answer.status_code == 200, answer.text
        return str(answer.json()["url"])

    def authorise(self, url: str, **said: str) -> str:
        """Sign in at the provider as `said`; the address it sends the browser back to."""
        own = urlsplit(url).netloc
        with httpx2.Client(cookies=self.cookies) as away:
            for _ in range(8):
                answer = away.get(url)
                assert answer.status_code in (302, 303), answer.text
                url = str(httpx2.URL(url).join(answer.headers["location"]))
                if urlsplit(url).netloc != own:
                    self.cookies = away.cookies
                    return url
                if "/interaction/" in url:
                    url = str(httpx2.URL(url).copy_merge_params(said))
        raise AssertionError(f"the provider never sent the browser back: {url}")

    def come_back(self, url: str) -> str:
        """Follow the provider's answer to our server; the page that it leads to."""
        answer = self.browser.get(url, follow_redirects=False)
        assert answer.status_code == 303, answer.text
        return str(answer.headers["location"])

    def sign_in(self, provider: str = "uni", next_page: str = "/", **said: str) -> str:
        """All of it; the page that it leads to."""
        return self.come_back(self.authorise(self.begin(provider, next_page), **said))

    def account(self) -> Any:
        """Who is signed in here; None where nobody is."""
        return self.browser.get("/api/admin/session").json()["account"]


def state_of(url: str) -> str:
    """The state of a request to the provider."""
    return parse_qs(urlsplit(url).query)["state"][0]
