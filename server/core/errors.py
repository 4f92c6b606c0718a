"""What the server refuses: one base class, one JSON shape, and words for what a request should have held."""

from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, Field

from experiments.errors import as_toml, counted, expectation

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
        return "this value is required but missing"
    if kind == "extra_forbidden":
        return "unknown value; remove it"
    if kind == "json_invalid":
        return f"expected JSON, got something else ({detail['ctx']['error']})"
    expected = FORMS.get(kind) or expectation(detail)
    if expected is None:
        return str(detail["msg"]).removeprefix("Value error, ")
    came = as_toml(given) if detail["loc"][0] == "query" else _kind(given)
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


# One base class and one JSON shape for everything the server refuses.


class ApiError(Exception):
    """Base of every refusal: a status, a code for programs, a sentence for people.

    A subclass names what differs from its base: `class NotFound(ApiError, status=404, code="not_found")`. The
    message says what was expected, what came, and what to do. Refusals of somebody who tries what is
    not hers are `audited`.
    """

    status: ClassVar[int] = 400
    code: ClassVar[str] = "bad_request"
    audited: ClassVar[bool] = False

    def __init_subclass__(cls, status: int = 0, code: str = "", *, audited: bool = False) -> None:
        cls.status, cls.code = status or cls.status, code or cls.code
        cls.audited = audited or cls.audited

    def __init__(self, message: str, *, headers: dict[str, str] | None = None, **details: Any) -> None:
        super().__init__(message)
        self.message = message
        self.details = details
        self.headers = headers


class NotFound(ApiError, status=404, code="not_found"):
    """Nothing is there."""


class Conflict(ApiError, status=409, code="conflict"):
    """The request contradicts what is stored."""


class TooManyRequests(ApiError, status=429, code="too_many_requests"):
    """A rate limit was reached; try again later."""


class Invalid(ApiError, status=422, code="invalid"):
    """The request is well-formed, but its content is not acceptable."""


class ErrorDetail(BaseModel):
    """What went wrong."""

    code: str = Field(description="Short name of the error, for programs.")
    message: str = Field(description="A plain message: expected, got, what to do.")
    details: dict[str, Any] = Field(description="Further values, by error code.")


class ErrorBody(BaseModel):
    """The shape of every answer with a status of 400 or above."""

    error: ErrorDetail


ERROR_RESPONSES: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": ErrorBody, "description": "Refused"},
    "422": {"model": ErrorBody, "description": "The content of the request is not valid"},
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


# Answers encoded once: FastAPI would look at each again, in a separate thread, before it encodes it.

Answer = TypeVar("Answer", bound=BaseModel)


def json_response(answer: Answer, status: int = 200, exclude: Any = None) -> Answer:
    """The answer as the response that it becomes. An endpoint returns it as if it were the answer itself."""
    content = answer.model_dump_json(exclude=exclude)
    return Response(content, status, media_type="application/json")  # type: ignore[return-value]
