"""Generated requests to the whole OpenAPI description: refused or served, never a 5xx."""

from typing import Any

import pytest
import schemathesis
import schemathesis.specs.openapi.schemas  # now: Python 3.11 cannot always parse what it loads beside threads
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, Phase, given, settings

from tests.helpers.admins import Admin
from tests.helpers.studies import Participant

EXAMPLES = 4
"""An operation; about 60 operations."""

pytestmark = [
    pytest.mark.filterwarnings("ignore::hypothesis.errors.NonInteractiveExampleWarning"),
]
STREAMS = ("/stream",)


def operations(client: TestClient) -> list[Any]:
    schema = schemathesis.openapi.from_dict(client.get("/api/openapi.json").json())
    found = [result.ok() for result in schema.get_all_operations()]
    return [operation for operation in found if not operation.path.endswith(STREAMS)]


def pairs(files: Any) -> list[tuple[str, Any]]:
    return list(files.items()) if isinstance(files, dict) else list(files)


def as_file(value: Any) -> Any:
    """What a client can send as a file; a number or the like is made where a schema asks for bytes."""
    if isinstance(value, tuple):
        return (value[0], as_file(value[1]), *value[2:])
    return value if isinstance(value, str | bytes) or hasattr(value, "read") else str(value)


def failures(caller: TestClient, found: list[Any], headers: dict[str, str]) -> list[str]:
    """What answered with 500 or more (503 says "not built" or "not ready" in its own shape)."""
    wrong: list[str] = []
    for operation in found:

        @settings(
            max_examples=EXAMPLES,
            deadline=None,
            database=None,
            derandomize=True,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy())
        def one(case: Any) -> None:
            given_args = case.as_transport_kwargs(base_url=str(caller.base_url))
            sent = {**(given_args.pop("headers", None) or {}), **headers}
            given_args.pop("cookies", None)
            if isinstance(given_args.get("data"), bytes):
                given_args["content"] = given_args.pop("data")
            if given_args.get("files"):
                given_args["files"] = [(name, as_file(value)) for name, value in pairs(given_args["files"])]
            answer = caller.request(headers=sent, **given_args)
            if answer.status_code >= 500 and answer.status_code != 503:
                wrong.append(f"{case.method} {case.formatted_path}: {answer.text[:200]}")

        one()
    return wrong


def test_a_participants_requests(client: TestClient, participant: Participant) -> None:
    participant.agree()
    found = [o for o in operations(client) if not o.path.startswith("/api/admin")]
    assert len(found) > 10
    assert failures(client, found, {"authorization": f"Bearer {participant.token}"}) == []


def test_an_owners_requests(client: TestClient, owner: Admin, participant: Participant) -> None:
    participant.agree()
    found = [o for o in operations(client) if o.path.startswith("/api/admin")]
    # Signing out and closing one's own account would end the test early.
    found = [o for o in found if not (o.method.upper() == "DELETE" and "session" in o.path)]
    assert len(found) > 20
    assert failures(owner.client, found, {}) == []
