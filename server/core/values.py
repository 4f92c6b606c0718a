"""Small values that every part shares: times, tokens, numbers and text."""

import base64
import hashlib
import hmac
import json
import re
import secrets
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Role = Literal["viewer", "experimenter", "owner"]
ROLES: tuple[Role, ...] = get_args(Role)
"""Each may do what those before it may, and more; on the server (`Account.role`) and in a workspace alike."""

# The server's time: always UTC, with its zone.


def now() -> datetime:
    """The present moment in UTC."""
    return datetime.now(UTC)


def iso(moment: datetime) -> str:
    """ISO 8601 with microseconds and Z, the form of `saved_at` in the view and in receipts."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")


# Opaque 128-bit tokens: stored as hashes, derived from the secret key so that a link can be shown again.

TOKEN_BYTES = 16


def new_public_id() -> str:
    """A random identifier that may be shown and exported: 16 hexadecimal digits."""
    return secrets.token_hex(8)


def new_token() -> str:
    """A random url-safe token of 128 bits."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def new_pseudonym_key() -> str:
    """A random key for the pseudonyms of one study: 64 hexadecimal digits."""
    return secrets.token_hex(32)


def derived_token(key: bytes, purpose: str, public_id: str) -> str:
    """The url-safe 128-bit token of `public_id`: not to be made without the key, stored nowhere."""
    digest = hmac.new(key, f"{purpose}:{public_id}".encode(), hashlib.sha256).digest()
    return base64.urlsafe_b64encode(digest[:TOKEN_BYTES]).decode("ascii").rstrip("=")


def hash_token(token: str) -> str:
    """What the database keeps of a token: 64 hexadecimal digits."""
    return hashlib.sha256(token.encode("utf-8")).hexdigest()


# Numbers that people send: as large as the columns that hold them.

Number = Annotated[int, Field(ge=1, le=2**31 - 1)]
"""Number of a version, of a data series, of a row: from 1 to what an integer column of PostgreSQL holds."""


# What every body that an endpoint takes has in common.


class RequestBody(BaseModel):
    """A body with a key that is not declared is refused: a misspelled one would do nothing, unsaid."""

    model_config = ConfigDict(extra="forbid")


# Text that can be stored and sent: no lone surrogate or NUL comes in; what is there goes out visibly.
#
# JSON can name half of a surrogate pair (backslash u d800), which no UTF-8 text can hold: once stored it
# would end every export, backup and copy that meets it.

REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
TOO_DEEP = "(nested too deeply to be shown)"
_UNSTORABLE = re.compile("[\0\ud800-\udfff]")
_SUSPICIOUS = re.compile(rb"\\u(?:[dD][89a-fA-F]|0000)")
"""Escapes that may name a surrogate or NUL; only reading the JSON shows whether they do."""


def is_storable(text: str) -> bool:
    """True where every database, file and answer can hold this text."""
    return _UNSTORABLE.search(text) is None


def storable_value(value: Any) -> Any:
    """`value` (as JSON gives it) with every NUL and lone surrogate, in names too, replaced by U+FFFD."""
    try:
        return _storable(value)
    except RecursionError:
        return TOO_DEEP


def _storable(value: Any) -> Any:
    if isinstance(value, str):
        return _UNSTORABLE.sub(REPLACEMENT, value)
    if isinstance(value, dict):
        return {_storable(name): _storable(content) for name, content in value.items()}
    return [_storable(content) for content in value] if isinstance(value, list) else value


VisibleObject = Annotated[dict[str, Any], BeforeValidator(storable_value)]
"""A stored JSON object as an answer shows it."""


def encode_text(text: str) -> bytes:
    """`text` in UTF-8, what cannot be encoded made visible."""
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError:
        return _UNSTORABLE.sub(REPLACEMENT, text).encode("utf-8")


def body_problem(body: bytes) -> str | None:
    """Why a request's body cannot be taken as text; None if it can, or if it is not JSON (reported later)."""
    try:
        body.decode("utf-8")
    except UnicodeDecodeError as error:
        return f"expected text in UTF-8; byte {error.start} is not"
    if b"\0" in body:
        return "expected text in UTF-8 without NUL characters"
    if _SUSPICIOUS.search(body) is None:
        return None
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    for text in _texts(content):
        if not is_storable(text):
            return f"a text holds a character that cannot be stored (half of a pair, or NUL): {text[:40]!a}"
    return None


def _texts(content: Any) -> Iterator[str]:
    """Every text of a JSON value, names included; without recursion, for it comes from anybody."""
    waiting = [content]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            yield value
        elif isinstance(value, dict):
            yield from value
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)
