"""What the log says, and above all what it does not."""

import json
import logging
import logging.config
import subprocess
import sys
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy.exc import IntegrityError

from server.context import Services
from server.core.logs import JsonLines, PlainLines, UvicornFilter, describe_error, logging_configuration
from server.core.settings import Settings
from server.operations.metrics import Observer

SECRET = "born in Liege"


def record_of(error: BaseException) -> logging.LogRecord:
    try:
        raise error
    except type(error):
        return logging.LogRecord("palpebra", logging.ERROR, __file__, 1, "request failed", (), sys.exc_info())


def test_a_line_is_one_json_object_with_the_places_an_error_passed() -> None:
    line = JsonLines().format(record_of(OSError("no space left")))
    told = json.loads(line)
    assert "\n" not in line
    assert told["message"] == "request failed"
    assert told["error"] == "OSError: no space left"
    assert told["frames"][-1].endswith("record_of")
    assert told["time"].endswith("Z")


@pytest.mark.parametrize("formatter", [JsonLines(), PlainLines()])
@pytest.mark.parametrize(
    "error",
    [
        ValueError(SECRET),
        KeyError(SECRET),
        IntegrityError("INSERT", {"comment": SECRET}, Exception(f"duplicate key\nDETAIL: Key ({SECRET})")),
    ],
)
def test_what_a_person_sent_is_not_logged(formatter: logging.Formatter, error: Exception) -> None:
    assert SECRET not in formatter.format(record_of(error))


def test_the_databases_own_first_line_is_kept() -> None:
    assert (
        describe_error(IntegrityError("x", {}, Exception("duplicate key\nDETAIL")))
        == "IntegrityError: duplicate key"
    )


@pytest.mark.parametrize(
    ("line", "kept"),
    [
        ("Exception in ASGI application\n", False),
        ("Unsupported upgrade request.", False),
        ("No supported WebSocket library detected. Please use ...", False),
        ("Invalid HTTP request received.", True),
    ],
)
def test_uvicorn_reports_no_failure_twice_and_nothing_of_websockets(line: str, kept: bool) -> None:
    record = logging.LogRecord("uvicorn.error", logging.WARNING, "", 1, line, (), None)
    assert UvicornFilter().filter(record) is kept


@pytest.mark.parametrize("form", ["json", "text"])
def test_the_configuration_is_one_that_logging_takes(form: str) -> None:
    configuration = logging_configuration(Settings(log_format=form))  # type: ignore[arg-type]
    logging.config.DictConfigurator(configuration)
    expected = JsonLines if form == "json" else PlainLines
    assert configuration["formatters"]["lines"]["()"] is expected


@pytest.mark.parametrize(("which", "lines"), [("all", 1), ("none", 0), ("problems", 0)])
def test_a_request_is_logged_by_its_route(
    client: TestClient, services: Services, caplog: pytest.LogCaptureFixture, which: Any, lines: int
) -> None:
    settings = services.settings.model_copy(update={"log_requests": which})
    watched = TestClient(Observer(client.app, settings))
    with caplog.at_level(logging.INFO, logger="palpebra.requests"):
        watched.get("/api/links/a-secret-token")
    assert len(caplog.records) == lines
    for record in caplog.records:
        assert "secret" not in JsonLines().format(record)
        assert record.__dict__["fields"]["route"] == "/api/links/{link_token}"


def test_no_address_that_the_server_calls_is_logged() -> None:
    """A webhook's address is its secret; the client would log it with every request."""
    # In a separate process: the configuration is that of the whole process.
    program = (
        "import logging, logging.config\n"
        "from server.core.logs import logging_configuration\n"
        "from server.core.settings import Settings\n"
        "logging.config.dictConfig(logging_configuration(Settings()))\n"
        "for name in ('httpx2', 'httpcore2.connection'):\n"
        "    logging.getLogger(name).info('HTTP Request: POST https://hooks.example.org/%s', 'SECRET')\n"
        "logging.getLogger('palpebra').warning('a line')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "a line" in done.stderr + done.stdout
    assert "SECRET" not in done.stderr + done.stdout
