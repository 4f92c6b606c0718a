"""Logs without personal data: one JSON object per line, or plain lines for a terminal.

No internet address, no token, no answer is ever written. An exception is reported by its type and the places
it passed; its own words are kept only where they cannot quote what a person sent.
"""

import json
import logging
import sys
import traceback
from datetime import UTC, datetime
from types import TracebackType
from typing import Any

from sqlalchemy.exc import DBAPIError

from server.core.settings import Settings

QUIET = (
    "uvicorn",
    "uvicorn.error",
    "uvicorn.asgi",
    "alembic",
    "alembic",
    "sqlalchemy",
    "botocore",
    "boto3",
    "s3transfer",
    "urllib3",
    # They name the address of every request, and a webhook's address is a secret.
    "httpx2",
    "httpcore2",
)

NEEDLESS = (
    "Exception in ASGI application",  # our own handler has logged it
    "Unsupported upgrade request",  # there is no WebSocket here, and whoever asks for one would fill the log
    "No supported WebSocket library detected",
)
"""How lines of uvicorn begin that are left out."""


class JsonLines(logging.Formatter):
    """Each record as one JSON object: time, level, logger, message, fields, error."""

    def format(self, record: logging.LogRecord) -> str:
        """One line."""
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **getattr(record, "fields", {}),
        }
        if record.exc_info and record.exc_info[1] is not None:
            line["error"] = describe_error(record.exc_info[1])
            line["frames"] = frames(record.exc_info[1].__traceback__)
        return json.dumps(line, ensure_ascii=False, default=str)


class PlainLines(logging.Formatter):
    """Lines for people, with the same reserve."""

    def format(self, record: logging.LogRecord) -> str:
        """One line, and the places an exception passed."""
        fields = " ".join(f"{name}={value}" for name, value in getattr(record, "fields", {}).items())
        line = f"{record.levelname.lower()}: {record.getMessage()} {fields}".rstrip()
        if record.exc_info and record.exc_info[1] is not None:
            line += f": {describe_error(record.exc_info[1])}"
            line += "".join(f"\n    {frame}" for frame in frames(record.exc_info[1].__traceback__))
        return line


class UvicornFilter(logging.Filter):
    """Leave out what uvicorn logs in addition to our own lines."""

    def filter(self, record: logging.LogRecord) -> bool:
        """False for what is said already, or says nothing of this server."""
        return not str(record.msg).startswith(NEEDLESS)


def describe_error(error: BaseException) -> str:
    """The exception's type; its words only where they come from the system or the database's first line."""
    kind = type(error).__name__
    if isinstance(error, DBAPIError) and error.orig is not None:
        # Further lines (DETAIL) quote the values of the row.
        return f"{kind}: {(str(error.orig).strip().splitlines() or [''])[0]}"
    if isinstance(error, OSError | RuntimeError):
        return f"{kind}: {error}"
    return kind


def frames(trace: TracebackType | None) -> list[str]:
    """The places the exception passed, `file:line function`, the innermost last."""
    return [f"{frame.filename}:{frame.lineno} {frame.name}" for frame in traceback.extract_tb(trace)]


def logging_configuration(settings: Settings) -> dict[str, Any]:
    """What `logging.config` and uvicorn take: one handler on stderr for everything."""
    as_json = settings.log_format == "json" or (settings.log_format == "auto" and not sys.stderr.isatty())
    formatter = JsonLines if as_json else PlainLines
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "formatters": {"lines": {"()": formatter}},
        "filters": {"needless": {"()": UvicornFilter}},
        "handlers": {
            "stderr": {
                "class": "logging.StreamHandler",
                "stream": "ext://sys.stderr",
                "formatter": "lines",
                "filters": ["needless"],
            }
        },
        "root": {"handlers": ["stderr"], "level": "INFO" if as_json else "WARNING"},
        "loggers": {name: {"level": "WARNING"} for name in QUIET},
    }
