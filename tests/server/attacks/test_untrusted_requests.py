"""What a request says of itself is not believed: its sender's address, its site, the form of its body."""

import http.client
import json
import re
import socket
import urllib.request

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from tests.helpers.admins import Admin
from tests.helpers.attacked import Attacked
from tests.helpers.studies import StudyInDatabase

ON_SQLITE = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def sign_in(port: int, forwarded_for: str) -> int:
    """The status of a wrong password whose sender claims another address."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    headers = {"content-type": "application/json", "x-forwarded-for": forwarded_for}
    connection.request(
        "POST", "/api/admin/session", json.dumps({"name": "ada", "password": "wrong"}), headers
    )
    status = connection.getresponse().status
    connection.close()
    return status


@ON_SQLITE
def test_a_claimed_address_does_not_pass_the_sign_in_limits(attacked: Attacked) -> None:
    """As `make run` starts it: nobody has named a proxy that may say so."""
    answers = [sign_in(attacked.port, f"203.0.{number}.7") for number in range(12)]
    assert 429 in answers


@ON_SQLITE
@pytest.mark.parametrize(
    "body",
    [b"zz\r\nhello\r\n0\r\n\r\n", b"5\r\nhello", b"-1\r\n\r\n", b"ffffffffffffffffff\r\nx\r\n0\r\n\r\n"],
    ids=["not a number", "cut off", "negative", "too large"],
)
@pytest.mark.parametrize("path", ["/api/unsupported", "/api/admin/session", "/api/admin/uploads"])
def test_malformed_chunks_are_not_counted_as_faults_of_the_server(
    attacked: Attacked, path: str, body: bytes
) -> None:
    kind = "content-type: application/json\r\ntransfer-encoding: chunked"
    head = f"POST {path} HTTP/1.1\r\nhost: x\r\n{kind}\r\n\r\n"
    with socket.create_connection(("127.0.0.1", attacked.port), timeout=30) as connection:
        connection.sendall(head.encode() + body)
        connection.shutdown(socket.SHUT_WR)
        while connection.recv(65536):
            pass
    with urllib.request.urlopen(f"{attacked.url}/metrics") as answer:
        counts = re.findall(r'palpebra_answers_total\{.*status="5\d\d"\} (\S+)', answer.read().decode())
    assert [float(count) for count in counts if float(count)] == []


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-site"}, 403),
        ({"sec-fetch-site": "same-origin"}, 201),
        ({"sec-fetch-site": "none"}, 201),
        ({"origin": "http://localhost:8000"}, 201),
    ],
)
def test_a_change_by_cookie_must_say_which_site_asks(
    experimenter: Admin, headers: dict[str, str], status: int
) -> None:
    del experimenter.client.headers["sec-fetch-site"]
    answer = experimenter.client.post(
        "/api/admin/tokens", json={"name": "x", "scopes": ["read"], "days": 1}, headers=headers
    )
    assert answer.status_code == status, answer.text


@pytest.mark.parametrize(
    "address",
    ["/runs?search=%00", "/runs?search=a%00b", "/runs?show=%00", "/runs/%00", "/data/ratings.csv?x=%00"],
)
def test_a_nul_in_an_address_is_refused_by_every_database_alike(
    owner: Admin, study: StudyInDatabase, services: Services, client: TestClient, address: str
) -> None:
    answer = owner.get(f"/studies/short{address}")
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "invalid_text")
