"""The second factor: time-based one-time codes (RFC 6238) and recovery codes.

The database keeps a random number; the secret itself is derived from it with the server's key, so that a
copy of the database alone lets nobody sign in.
"""

import base64
import hashlib
import hmac
import io
import secrets
import time

import pyotp
import segno

from server.tokens import hash_token

RECOVERY_CODES = 10
STEP_S = 30


def new_seed() -> str:
    """A random seed to keep with the account."""
    return secrets.token_hex(16)


def secret_of(key: bytes, seed: str) -> str:
    """The base32 secret an authenticator app holds, derived from the server's key and the account's seed."""
    digest = hmac.new(key, f"totp:{seed}".encode(), hashlib.sha256).digest()
    return base64.b32encode(digest[:20]).decode("ascii")


def provisioning_uri(secret: str, name: str) -> str:
    """The otpauth:// address that authenticator apps read."""
    return pyotp.TOTP(secret).provisioning_uri(name=name, issuer_name="Palpebra")


def qr_svg(text: str) -> str:
    """`text` as a QR code, an SVG document."""
    stream = io.BytesIO()
    segno.make(text, error="m").save(stream, kind="svg", scale=4, border=2)
    return stream.getvalue().decode("utf-8")


def accepted_step(secret: str, code: str, last_step: int | None) -> int | None:
    """The time step `code` belongs to, one step early or late allowed; None where wrong or used before."""
    current = int(time.time()) // STEP_S
    totp = pyotp.TOTP(secret)
    for step in (current, current - 1, current + 1):
        if hmac.compare_digest(totp.at(step * STEP_S), code) and (last_step is None or step > last_step):
            return step
    return None


def new_recovery_codes() -> list[str]:
    """Ten codes for the day the phone is lost; each works once."""
    return [f"{secrets.token_hex(4)}-{secrets.token_hex(4)}" for _ in range(RECOVERY_CODES)]


def is_recovery_code(code: str) -> bool:
    """Whether a code has the form of those of the day the phone is lost, not that of an app's."""
    return "-" in code.strip()


def hash_recovery_code(code: str) -> str:
    """What the database keeps of a recovery code."""
    return hash_token(code.strip().casefold())
