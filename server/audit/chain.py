"""The chain of the audit log: each entry's hash holds the one before it, keyed by the server's secret.

With k a key derived from the secret key, s an entry's salt and d its details as JSON,

    D = HMAC-SHA256(k, "details" | s | d)                                               (1)
    H_n = HMAC-SHA256(k, "entry" | H_(n-1) | n | time | actor | action | kind | target | D)   (2)

Whoever can write to the database, but has not the key, cannot change, remove or put in an entry without
breaking (2) at it. What the database alone cannot tell is that the last entries were cut off, or the whole
chain taken away from rows that stay: keep the newest hash elsewhere (export, syslog) and verify with it.
Details can be erased with their salt, as data protection asks; D stays, and tells nothing without s.
"""

import hashlib
import hmac
import json
from datetime import UTC, datetime
from typing import Any, NamedTuple

START = "0" * 64
"""What stands for the hash before the first entry."""


class Entry(NamedTuple):
    """What the chain holds of an entry of the audit log."""

    position: int
    at: datetime
    actor: str
    action: str
    target_kind: str
    target: str


def chain_key(secret: bytes) -> bytes:
    """The key of the chain: of this purpose alone."""
    return hmac.new(secret, b"audit chain", hashlib.sha256).digest()


def details_digest(key: bytes, salt: str, details: dict[str, Any]) -> str:
    """Equation (1), 64 hexadecimal digits.

    >>> a = details_digest(b"k", "s", {"a": 1, "b": [2]})
    >>> a == details_digest(b"k", "s", {"b": [2], "a": 1}) != details_digest(b"k", "t", {"a": 1, "b": [2]})
    True
    """
    return _keyed(key, ["details", salt, details])


def entry_hash(key: bytes, previous: str, entry: Entry, digest: str) -> str:
    """Equation (2), 64 hexadecimal digits; `previous` is the hash of the entry before, or `START`."""
    at = entry.at.astimezone(UTC).isoformat(timespec="microseconds")
    return _keyed(key, ["entry", previous, entry.position, at, *entry[2:], digest])


def _keyed(key: bytes, parts: list[Any]) -> str:
    text = json.dumps(parts, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return hmac.new(key, text.encode("ascii"), hashlib.sha256).hexdigest()
