"""Backups encrypted in the age format (age-encryption.org/v1, X25519).

The server needs the public key alone. `age -d` of any implementation opens them. What is encrypted
is streamed: nothing in the open is on a disk.
"""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

import pyrage
from pyrage import x25519

from experiments.errors import InputError
from experiments.files import whole_private_file

ENDING = ".age"


def recipient_of(text: str) -> x25519.Recipient:
    """The public key of this text; InputError where it is none."""
    try:
        return x25519.Recipient.from_str(text.strip())
    except pyrage.RecipientError as error:
        raise InputError(
            f"expected a public key age1..., as server backup-key makes one, got '{text[:20]}'"
        ) from error


def identity_in(path: Path) -> x25519.Identity:
    """The private key in a file of `server backup-key` or `age-keygen`; InputError where none is."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as a private key: {error}") from error
    keys = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    try:
        [key] = keys
        return x25519.Identity.from_str(key)
    except (ValueError, pyrage.IdentityError) as error:
        raise InputError(f"{path}: expected one line AGE-SECRET-KEY-..., as of server backup-key") from error


def make_identity(path: Path) -> str:
    """Write a new private key, mode 600, and give its public key; a file that is there is never replaced."""
    if path.exists():
        raise InputError(f"{path} is there already; a private key is never replaced, name another file")
    identity = x25519.Identity.generate()
    public = str(identity.to_public())
    with whole_private_file(path) as stream:
        stream.write(f"# public key: {public}\n{identity}\n".encode())
    return public


@contextmanager
def encrypted(write: Callable[[IO[bytes]], None], recipient: x25519.Recipient) -> Iterator[IO[bytes]]:
    """What `write` writes, encrypted, to be read while it is written; its error comes out of the reader.

    Parameters
    ----------
    write : callable
        Given a stream, in a thread of its own.
    """
    with (
        _produced(write) as plain,
        _produced(lambda target: pyrage.encrypt_io(plain, target, [recipient])) as sealed,
    ):
        yield sealed


def decrypt(source: IO[bytes], target: IO[bytes], identity: x25519.Identity, name: str) -> None:
    """Write what the source holds in the open.

    Raises
    ------
    InputError
        It was encrypted for another key, is cut short or was changed.
    """
    try:
        pyrage.decrypt_io(source, target, [identity])
    except (pyrage.DecryptError, OSError) as error:
        raise InputError(
            f"{name} cannot be decrypted: damaged, cut short, or encrypted for another key ({error})"
        ) from error


class _Reader:
    """The end of a pipe; there the writer's error is raised, so that nobody takes a part for the whole."""

    def __init__(self, stream: IO[bytes], thread: threading.Thread, errors: list[BaseException]) -> None:
        self._stream, self._thread, self._errors = stream, thread, errors

    def read(self, size: int = -1) -> bytes:
        """At most so many bytes; none at the end."""
        piece = self._stream.read(size)
        if not piece or size < 0:
            self._thread.join()
            if self._errors:
                raise self._errors[0]
        return piece

    def close(self) -> None:
        """Close it: the writer is told by its next write."""
        self._stream.close()


@contextmanager
def _produced(write: Callable[[IO[bytes]], None]) -> Iterator[IO[bytes]]:
    outlet, inlet = os.pipe()
    errors: list[BaseException] = []

    def run() -> None:
        try:
            with os.fdopen(inlet, "wb") as stream:
                try:
                    write(stream)
                except BaseException as error:
                    errors.append(error)  # before the reader sees the end
                    raise
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run, daemon=True)
    reader = _Reader(os.fdopen(outlet, "rb"), thread, errors)
    thread.start()
    try:
        yield reader  # type: ignore[misc]
    except BaseException as error:
        if errors and not isinstance(errors[0], BrokenPipeError):
            raise errors[0] from error
        raise
    finally:
        with suppress(OSError):
            reader.close()
        thread.join()
