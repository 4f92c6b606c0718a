"""Opaque 128-bit tokens: stored as hashes, derived from the secret key so that a link can be shown again."""

import base64
import hashlib
import hmac
import secrets

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
