"""One handler for what the server refuses and for what fails: each is answered in the one JSON shape."""

import logging
from collections.abc import Awaitable, Callable
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from sqlalchemy.exc import DataError, DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException

from experiments.errors import InputError
from server.core.db import is_away, is_busy
from server.core.errors import ApiError, error_response, refusal_response, refused_value
from server.core.logs import describe_error

log = logging.getLogger("palpebra")


def install_error_handlers(
    app: FastAPI, note_refusal: Callable[[Request, ApiError], Awaitable[None]]
) -> None:
    """Make `app` answer every refusal in the one shape.

    Parameters
    ----------
    note_refusal : callable
        Gets each refusal that is `audited`, before it is answered.
    """

    async def refused(request: Request, error: Exception) -> JSONResponse:
        if isinstance(error, ApiError) and error.audited:
            await note_refusal(request, error)
        return await _answer_refusal(request, error)

    app.add_exception_handler(ApiError, refused)
    app.add_exception_handler(InputError, _bad_input)
    app.add_exception_handler(RequestValidationError, _not_valid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(OverflowError, _out_of_range)
    app.add_exception_handler(DataError, _out_of_range)
    app.add_exception_handler(DBAPIError, _database)
    app.add_exception_handler(PoolTimeout, _database)
    app.add_exception_handler(Exception, _answer_unexpected)


async def _answer_refusal(_request: Request, error: Exception) -> JSONResponse:
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
    <title>Page not found</title>
  </head>
  <body>
    <h1>Page not found</h1>
    <p>Please check the address. To take part in a study, use the link that you received.</p>
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
        "A value is out of range: a number is too large, or a text contains a character that cannot be "
        "stored."
    )
    return error_response(422, "out_of_range", message)


async def _database(_request: Request, error: Exception) -> JSONResponse:
    if not is_away(error):
        raise error
    if is_busy(error):
        log.error("the database is busy: %s", describe_error(error))
        message = "The database is busy because of another program. Nothing was stored. Please try again."
        return error_response(503, "database_busy", message, headers={"retry-after": "2"})
    log.error("the database is not reachable: %s", describe_error(error))
    message = "The server cannot reach its database at the moment. Please try again."
    return error_response(503, "database_away", message, headers={"retry-after": "2"})


async def _answer_unexpected(_request: Request, error: Exception) -> JSONResponse:
    log.error("request failed", exc_info=error)
    return error_response(500, "internal", "The server had an internal error. Please try again.")
