"""What a command was refused for, in one line: by the server itself, or by its settings."""

from pydantic import ValidationError
from pydantic_core import ErrorDetails
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from experiments.wrong_values import wrong_value
from server.db import is_away, is_busy
from server.errors import ApiError
from server.settings import Settings


def refusal(error: Exception) -> str | None:
    """The line; None for what is no refusal."""
    if isinstance(error, ApiError):
        return error.message
    if isinstance(error, ValidationError) and error.title == Settings.__name__:
        return "; ".join(map(_setting, error.errors()))
    if isinstance(error, PoolTimeout):
        return "no connection to the database came free: try again, or raise PALPEBRA_DATABASE_POOL"
    if is_busy(error):
        return "another program keeps the database locked: end it, or try again when it is done"
    if isinstance(error, DBAPIError) and is_away(error):
        said = str(error.orig).strip().splitlines() or ["it does not answer"]
        return f"the database is away ({said[0]}); see DATABASE_URL, then run: server doctor"
    return None


def _setting(problem: ErrorDetails) -> str:
    name = "__".join(map(str, problem["loc"])).upper() or "a setting"
    shown = name if name.startswith(("PALPEBRA_", "DATABASE_")) else f"PALPEBRA_{name}"
    return f"{shown}: {wrong_value(problem)}; see docs/settings.md"
