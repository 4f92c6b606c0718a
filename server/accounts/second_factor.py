"""The second factor: time-based one-time codes (RFC 6238) and recovery codes.

The database keeps a random number; the secret itself is derived from it with the server's key, so that a
copy of the database alone lets nobody sign in. Once the server's key was changed, it keeps the secret itself,
wrapped under the new key (AES key wrap with padding, RFC 5649, under HKDF-SHA-256), so that phones go on.
"""

import base64
import hashlib
import hmac
import io
import secrets
import textwrap
import time

import pyotp
import segno
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.keywrap import (
    InvalidUnwrap,
    aes_key_unwrap_with_padding,
    aes_key_wrap_with_padding,
)

from server.tokens import hash_token

RECOVERY_CODES = 10
STEP_S = 30
CODE_BYTES = 15
"""Of a recovery code: 120 bits, which nobody guesses offline either (ASVS 2.6.2 asks for 112)."""
WRAPPED, WRAPPING = "wrapped:", b"palpebra second factors"


def new_seed() -> str:
    """A random seed to keep with the account."""
    return secrets.token_hex(16)


def secret_of(key: bytes, kept: str) -> str:
    """The base32 secret an authenticator app holds, from the server's key and what is kept of the account.

    Under another key it is another secret, which fits no code.
    """
    held = _unwrapped(key, kept) if kept.startswith(WRAPPED) else None
    if held is None:
        held = hmac.new(key, f"totp:{kept}".encode(), hashlib.sha256).digest()[:20]
    return base64.b32encode(held).decode("ascii")


def rewrapped(old_key: bytes, key: bytes, kept: str) -> str:
    """What to keep of an account under another key of the server, so that its app's secret stays.

    What is wrapped already, but not under `old_key`, is given back as it is.
    """
    if kept.startswith(WRAPPED) and _unwrapped(old_key, kept) is None:
        return kept
    secret = base64.b32decode(secret_of(old_key, kept))
    return WRAPPED + base64.b64encode(aes_key_wrap_with_padding(_wrapping_key(key), secret)).decode("ascii")


def _unwrapped(key: bytes, kept: str) -> bytes | None:
    try:
        return aes_key_unwrap_with_padding(_wrapping_key(key), base64.b64decode(kept.removeprefix(WRAPPED)))
    except InvalidUnwrap:
        return None


def _wrapping_key(key: bytes) -> bytes:
    return HKDF(algorithm=SHA256(), length=32, salt=None, info=WRAPPING).derive(key)


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
    """Ten codes for the day the phone is lost, six groups of four characters; each works once."""
    drawn = (base64.b32encode(secrets.token_bytes(CODE_BYTES)).decode("ascii") for _ in range(RECOVERY_CODES))
    return ["-".join(textwrap.wrap(code.lower(), 4)) for code in drawn]


def is_recovery_code(code: str) -> bool:
    """Whether a code has the form of those of the day the phone is lost, not that of an app's."""
    return "-" in code.strip()


def hash_recovery_code(code: str) -> str:
    """What the database keeps of a recovery code."""
    return hash_token(code.strip().casefold())
