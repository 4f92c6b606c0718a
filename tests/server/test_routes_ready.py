"""Routes are put together before the first request, which waited for it, and once in a process."""

import gc

from fastapi.dependencies.models import Dependant
from fastapi.testclient import TestClient

from server.app import create_app, every_route
from server.context import Services


def test_no_request_puts_routes_together(services: Services) -> None:
    """What FastAPI makes of an endpoint's parameters is there before the first request, not after it."""
    every_route.cache_clear()
    client = TestClient(create_app(services.settings), raise_server_exceptions=False)
    before = dependants()
    assert before > 100
    for path in ("/healthz", "/api/admin/studies", "/api/run", "/run/none", "/nothing"):
        client.get(path)
    assert dependants() == before
    create_app(services.settings)
    assert dependants() == before, "another application of the process shares them"


def dependants() -> int:
    gc.collect()
    return sum(isinstance(one, Dependant) for one in gc.get_objects())
