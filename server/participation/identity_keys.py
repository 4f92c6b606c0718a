"""Recruiters' IDs under a key for each run, so that erasing the key erases the id wherever it was copied.

Each run draws a key k of 256 bits. What the recruiter's address said is kept as AES-256-GCM(k, JSON), with
the run's public id as associated data. k itself is kept wrapped (AES key wrap, RFC 3394) under HKDF-SHA-256
of the installation's secret key, in a separate table that no backup holds: a dump of the database alone
opens nothing, and a backup without the key file opens nothing.
"""

import base64
import binascii
import hashlib
import hmac
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.keywrap import InvalidUnwrap, aes_key_unwrap, aes_key_wrap

from experiments.errors import InputError

PURPOSE = b"palpebra identity keys"
HASH_PURPOSE = "duplicates"
# AES-256, and the nonce length that GCM is made for.
KEY_BYTES, NONCE_BYTES = 32, 12


@dataclass(frozen=True)
class ParticipantIdentity:
    """Who a run's person is to the recruiter.

    Attributes
    ----------
    identifier : str
        The person's id; empty where the address named nobody.
    parameters : dict of str to str
        Of the address.
    """

    identifier: str = ""
    parameters: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Sealed:
    """What is stored of `ParticipantIdentity`, in two tables; both texts are Base64.

    Attributes
    ----------
    content : str
        Nonce and AES-GCM of it.
    wrapped_key : str
        The run's key, wrapped.
    """

    content: str
    wrapped_key: str


class UnreadableError(InputError):
    """The key does not open it: it was wrapped under another secret key, or the row was changed."""

    def __init__(self, what: str) -> None:
        super().__init__(
            f"the recruiter's ID of {what} cannot be read with this installation's secret key; where the key "
            "was changed run: server database rewrap OLD_KEY_FILE"
        )


def identifier_hash(study_key: str, identifier: str) -> str:
    """HMAC-SHA-256 of a recruiter's ID under the study's key; empty for none."""
    if not identifier:
        return ""
    # Surrogates: an address may hold bytes that are not UTF-8, and they are part of the id.
    named = f"{HASH_PURPOSE}:{identifier}".encode("utf-8", "surrogatepass")
    return hmac.digest(bytes.fromhex(study_key), named, hashlib.sha256).hex()


# Decision 0740: One key per recruiter ID, and no key in a backup.
def seal(secret: bytes, run: str, known_as: ParticipantIdentity) -> Sealed:
    """Encrypt under a new key; `secret` is the installation's key, `run` the run's public id."""
    # A new key for each run: a random nonce is then never used twice with it.
    key, nonce = AESGCM.generate_key(KEY_BYTES * 8), os.urandom(NONCE_BYTES)
    plain = json.dumps({"identifier": known_as.identifier, "parameters": dict(known_as.parameters)})
    # The run is associated data: content that is moved to another run's row does not open.
    content = nonce + AESGCM(key).encrypt(nonce, plain.encode(), run.encode())
    return Sealed(_text(content), wrap(secret, key))


def unseal(secret: bytes, run: str, sealed: Sealed) -> ParticipantIdentity:
    """Decrypt.

    Raises
    ------
    UnreadableError
        Another secret key, another run, or changed bytes.
    """
    try:
        key = unwrap(secret, sealed.wrapped_key)
        content = base64.b64decode(sealed.content)
        nonce, encrypted = content[:NONCE_BYTES], content[NONCE_BYTES:]
        plain = json.loads(AESGCM(key).decrypt(nonce, encrypted, run.encode()))
    # One error for all causes, which callers treat alike.
    except (UnreadableError, InvalidTag, ValueError, binascii.Error) as error:
        raise UnreadableError(f"run {run}") from error
    return ParticipantIdentity(plain["identifier"], plain["parameters"])


def rewrap(old_secret: bytes, secret: bytes, wrapped_key: str) -> str:
    """The same key of a run, wrapped under another secret key.

    Raises
    ------
    UnreadableError
        It was not wrapped under `old_secret`.
    """
    return wrap(secret, unwrap(old_secret, wrapped_key))


def wrap(secret: bytes, key: bytes) -> str:
    """A key of 32 bytes, wrapped under the installation's secret key; Base64."""
    return _text(aes_key_wrap(_wrapping_key(secret), key))


def unwrap(secret: bytes, wrapped: str) -> bytes:
    """The key behind `wrap`.

    Raises
    ------
    UnreadableError
        It was wrapped under another secret key, or changed.
    """
    try:
        return aes_key_unwrap(_wrapping_key(secret), base64.b64decode(wrapped))
    except (InvalidUnwrap, ValueError, binascii.Error) as error:
        raise UnreadableError("a run") from error


def _wrapping_key(secret: bytes) -> bytes:
    # `info` separates this key from others that are derived from the same secret.
    return HKDF(algorithm=SHA256(), length=KEY_BYTES, salt=None, info=PURPOSE).derive(secret)


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
