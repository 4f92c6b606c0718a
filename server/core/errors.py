"""One base class, one handler, one JSON shape for everything the server refuses."""

import logging
from collections.abc import Awaitable, Callable, Mapping
from http import HTTPStatus
from typing import Any, ClassVar, TypeVar

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from pydantic import BaseModel, Field
from sqlalchemy.exc import DataError, DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException

from experiments.errors import InputError, counted, expectation, shown
from server.core.db import is_away, is_busy
from server.core.logs import described

# What a request should have held and what it held, in words that repeat no password or token.

JSON_WORDS = {"a table": "an object", "a text in quotes": "a text"}
"""Words of TOML and what the same is called in a request."""
TIME = "a point in time such as 2026-11-23T09:30:00Z"
FORMS = {
    **dict.fromkeys(
        ("datetime_type", "datetime_parsing", "datetime_from_date_parsing", "timezone_aware"), TIME
    ),
    **dict.fromkeys(("uuid_type", "uuid_parsing"), "a UUID such as 123e4567-e89b-42d3-a456-426614174000"),
}
"""What requests have and declarations have not."""
MAX_NAME = 60


def refused_value(detail: Mapping[str, Any]) -> str:
    """One error of pydantic: the value's place, what was expected and what came.

    A value of the address is shown; of a body only its kind, since it may be secret.

    Examples
    --------
    >>> refused_value({"type": "int_parsing", "loc": ("query", "page"), "input": "two"})
    "query.page: expected a whole number, got 'two'"
    >>> refused_value({"type": "string_type", "loc": ("body", "password"), "input": 12345})
    'body.password: expected a text, got a number'
    """
    location = ".".join(str(part)[:MAX_NAME] for part in detail["loc"])
    return f"{location}: {_problem(detail)}"


def _problem(detail: Mapping[str, Any]) -> str:
    kind, given = detail["type"], detail.get("input")
    if kind == "missing":
        return "this value is required and missing"
    if kind == "extra_forbidden":
        return "there is no value of this name here; leave it out"
    if kind == "json_invalid":
        return f"expected JSON, got something else ({detail['ctx']['error']})"
    expected = FORMS.get(kind) or expectation(detail)
    if expected is None:
        return str(detail["msg"]).removeprefix("Value error, ")
    came = shown(given) if detail["loc"][0] == "query" else _kind(given)
    return f"expected {JSON_WORDS.get(expected, expected)}, got {came}"


def _kind(given: Any) -> str:
    if isinstance(given, str):
        return f"a text of {counted(len(given), 'character')}"
    if isinstance(given, list | tuple):
        return f"a list of {counted(len(given), 'item')}"
    if isinstance(given, bool):
        return "true" if given else "false"
    if given is None:
        return "nothing"
    return "a number" if isinstance(given, int | float) else "an object"


# One base class, one handler, one JSON shape for everything the server refuses.

log = logging.getLogger("palpebra")


class ApiError(Exception):
    """Base of every refusal: a status, a code for programs, a sentence for people.

    Subclasses set `status` and `code`; the message says what was expected, what came, and what to do. Those
    that tell of somebody who tries what is not hers are `audited`.
    """

    status: ClassVar[int] = 400
    code: ClassVar[str] = "bad_request"
    audited: ClassVar[bool] = False

    def __init__(self, message: str, *, headers: dict[str, str] | None = None, **details: Any) -> None:
        super().__init__(message)
        self.message = message
        self.details = details
        self.headers = headers


class NotFound(ApiError):
    """Nothing is there."""

    status = 404
    code = "not_found"


class Conflict(ApiError):
    """The request contradicts what is stored."""

    status = 409
    code = "conflict"


class TooManyRequests(ApiError):
    """A rate limit was reached; try again later."""

    status = 429
    code = "too_many_requests"


class Invalid(ApiError):
    """The request is well-formed, but its content is not acceptable."""

    status = 422
    code = "invalid"


class ErrorDetail(BaseModel):
    """What went wrong."""

    code: str = Field(description="Short name of the error, for programs.")
    message: str = Field(description="One plain sentence: expected, got, what to do.")
    details: dict[str, Any] = Field(description="Further values, by error code.")


class ErrorBody(BaseModel):
    """The shape of every answer with a status of 400 or above."""

    error: ErrorDetail


ERROR_RESPONSES: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": ErrorBody, "description": "Refused"},
    "422": {"model": ErrorBody, "description": "The request's content is not acceptable"},
}
"""For `responses=` of a router: documents the one error shape in the OpenAPI schema."""


def error_response(
    status: int, code: str, message: str, details: dict[str, Any] | None = None, headers: Any = None
) -> JSONResponse:
    """The one JSON shape of a refusal."""
    body = {"error": {"code": code, "message": message, "details": details or {}}}
    return JSONResponse(body, status_code=status, headers=headers)


def refusal_response(refusal: ApiError, **headers: str) -> JSONResponse:
    """The answer to a request that was refused, with further headers."""
    every = {**(refusal.headers or {}), **headers}
    return error_response(refusal.status, refusal.code, refusal.message, refusal.details, every)


def install_error_handlers(app: FastAPI, told: Callable[[Request, ApiError], Awaitable[None]]) -> None:
    """Make `app` answer every refusal in the one shape.

    Parameters
    ----------
    told : callable
        Is told of each refusal that is `audited`, before it is answered.
    """

    async def refused(request: Request, error: Exception) -> JSONResponse:
        if isinstance(error, ApiError) and error.audited:
            await told(request, error)
        return await _refused(request, error)

    app.add_exception_handler(ApiError, refused)
    app.add_exception_handler(InputError, _bad_input)
    app.add_exception_handler(RequestValidationError, _not_valid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(OverflowError, _out_of_range)
    app.add_exception_handler(DataError, _out_of_range)
    app.add_exception_handler(DBAPIError, _database)
    app.add_exception_handler(PoolTimeout, _database)
    app.add_exception_handler(Exception, _unexpected)


async def _refused(_request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, ApiError):
        raise error
    return refusal_response(error)


async def _bad_input(_request: Request, error: Exception) -> JSONResponse:
    return error_response(422, "bad_input", str(error))


async def _not_valid(request: Request, error: Exception) -> JSONResponse:
    if not isinstance(error, RequestValidationError):
        raise error
    if any(
        detail["loc"] == ("body",) and isinstance(detail.get("input"), bytes) for detail in error.errors()
    ):
        # Only a body that was not read as JSON is bytes still.
        sent = request.headers.get("content-type", "none")[:100]
        message = f"Expected a body with the Content-Type application/json, got {sent}."
        return error_response(415, "unsupported_media_type", message)
    problems = [refused_value(detail) for detail in error.errors()]
    return error_response(422, "invalid", problems[0], {"problems": problems})


async def _http(request: Request, error: Exception) -> Response:
    if not isinstance(error, HTTPException):
        raise error
    if error.status_code == 404 and _is_for_a_person(request):
        return HTMLResponse(_NOTHING_HERE, status_code=404)
    # Python has changed its mind about the name of 413.
    code = "too_large" if error.status_code == 413 else HTTPStatus(error.status_code).name.lower()
    return error_response(error.status_code, code, str(error.detail), headers=error.headers)


_NOTHING_HERE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8">
    <meta name="viewport" content="width=device-width, initial-scale=1">
    <title>Nothing is here</title>
  </head>
  <body>
    <h1>Nothing is here</h1>
    <p>The address may be mistyped. A study is reached by the link you were given.</p>
    <p><a href="/admin/">For experimenters</a></p>
  </body>
</html>
"""


def _is_for_a_person(request: Request) -> bool:
    """Whether a browser shows the answer as a page: it alone asks for HTML first, and not of the API."""
    first = request.headers.get("accept", "").split(",")[0].split(";")[0].strip().lower()
    return first == "text/html" and not request.url.path.startswith("/api/")


async def _out_of_range(_request: Request, _error: Exception) -> JSONResponse:
    # What no database column can hold: SQLite's driver and PostgreSQL say so only when they get it.
    message = (
        "A value is out of range: a number is too large, or a text holds a character that cannot be stored."
    )
    return error_response(422, "out_of_range", message)


async def _database(_request: Request, error: Exception) -> JSONResponse:
    if not is_away(error):
        raise error
    if is_busy(error):
        log.error("the database is busy: %s", described(error))
        message = "Another program keeps the database busy; nothing was stored, please try again."
        return error_response(503, "database_busy", message, headers={"retry-after": "2"})
    log.error("the database is away: %s", described(error))
    message = "The server cannot reach its database at the moment; please try again."
    return error_response(503, "database_away", message, headers={"retry-after": "2"})


async def _unexpected(_request: Request, error: Exception) -> JSONResponse:
    log.error("request failed", exc_info=error)
    return error_response(500, "internal", "The server failed; please try again.")


# Answers encoded once: FastAPI would look at each again, in a thread of its own, before it encodes it.

Answer = TypeVar("Answer", bound=BaseModel)


def finished(answer: Answer, status: int = 200, exclude: Any = None) -> Answer:
    """The answer as the response that it becomes. An endpoint returns it as if it were the answer itself."""
    content = answer.model_dump_json(exclude=exclude)
    return Response(content, status, media_type="application/json")  # type: ignore[return-value]
