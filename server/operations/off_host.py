"""Backups encrypted into a store of another host, and brought here again."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

from pyrage import x25519

from experiments.errors import InputError
from server.clock import iso, now
from server.context import Services
from server.operations import erasures
from server.operations.backup import Description, write_backup
from server.operations.backup_stores import BackupStore
from server.operations.encryption import ENDING, decrypt, encrypted
from server.operations.keys_apart import NAME, content_of_keys, installation

_INSTALLATION = re.compile(r"-([0-9a-f]{16})\.tar\.age$")


@dataclass(frozen=True)
class KeptBackup:
    """One backup of a store.

    Attributes
    ----------
    store : BackupStore
    name : str
    """

    store: BackupStore
    name: str


def back_up_to(
    services: Services,
    store: BackupStore,
    name: str,
    recipient: x25519.Recipient,
    *,
    with_clips: bool = True,
) -> tuple[str, Description]:
    """Write an encrypted backup into a store; its name there, and what is in it.

    Key file and ledger of erasures are there before the backup is, and take the place of older ones. Each has
    the installation's fingerprint and its moment in its name: installations that share a store leave one
    another's alone, and a backup that another overtook brings no key back, though none can be read here.

    Parameters
    ----------
    name : str
        Of the file, ending in .tar.

    Raises
    ------
    InputError
        The store cannot be written.
    """
    made: list[Description] = []
    ours = installation(services.settings.key)

    def write(stream: IO[bytes]) -> None:
        described, keys = write_backup(services, stream, with_clips=with_clips)
        _put_newest(store, _Kept(NAME, ours, keys.written_at), content_of_keys(keys), recipient)
        ledger = _Kept(erasures.NAME, ours, iso(now()))
        copy = erasures.copy_for_backup(services.settings, b"", keys.written_at)
        _put_newest(store, ledger, copy, recipient)
        made.append(described)

    kept_as = f"{name.removesuffix('.tar')}{ending_of(services.settings.key)}"
    with encrypted(write, recipient) as stream:
        store.put(kept_as, stream)
    return kept_as, made[0]


def ending_of(secret: bytes) -> str:
    """How the names of an installation's encrypted backups end."""
    return f"-{installation(secret)}.tar{ENDING}"


def installation_of(name: str) -> str | None:
    """The fingerprint in the name of an encrypted backup; None where there is none."""
    told = _INSTALLATION.search(name)
    return told[1] if told else None


@dataclass(frozen=True)
class _Kept:
    """What is kept beside encrypted backups, of an installation and a moment."""

    name: str
    installation: str
    moment: str

    def __str__(self) -> str:
        stem, _, suffix = self.name.partition(".")
        return f"{stem}-{self.installation}-{re.sub('[-:]', '', self.moment)}.{suffix}{ENDING}"


def _put_newest(store: BackupStore, kept: _Kept, content: bytes, recipient: x25519.Recipient) -> None:
    """Put a file and remove the older ones; where a newer one is there that one stays."""
    with encrypted(lambda stream: _write(stream, content), recipient) as stream:
        store.put(str(kept), stream)
    there = _named(store, kept.name, kept.installation)
    # One of the future is of a clock that was wrong: it would stay for ever.
    present = max(str(kept), str(replace(kept, moment=iso(now()))))
    newest = max(name for name in there if name <= present)
    for name in there:
        if name != newest:
            store.remove(name)


def _named(store: BackupStore, name: str, whose: str) -> list[str]:
    """The files of this name, by an installation, or any where it is not known; the newest last."""
    beginning = f"{name.partition('.')[0]}-{whose}"
    named = [entry.name for entry in store.entries() if entry.name.startswith(beginning)]
    return sorted(named, key=lambda one: one.rpartition("-")[2])


def _write(stream: IO[bytes], content: bytes) -> None:
    stream.write(content)


@contextmanager
def brought_here(kept: KeptBackup, folder: Path, identity: x25519.Identity | None) -> Iterator[Path]:
    """The backup in the open, as a file in `folder` with key file and ledger beside, removed afterwards.

    Raises
    ------
    InputError
        It is encrypted and no private key was given or it is another; the store does not answer.
    """
    files = [folder / kept.name.removesuffix(ENDING)]
    try:
        _bring(kept.store, kept.name, files[0], identity)
        for stored, name in _beside(kept):
            files.append(folder / name)
            _bring(kept.store, stored, files[-1], identity)
        yield files[0]
    finally:
        for file in files:
            file.unlink(missing_ok=True)


def _beside(kept: KeptBackup) -> Iterator[tuple[str, str]]:
    """Key file and ledger of a backup: as they are stored, and as they are called beside it."""
    whose = installation_of(kept.name) or ""
    for name in (NAME, erasures.NAME):
        if kept.name.endswith(ENDING):
            # Where somebody renamed the backup: restore refuses keys that are not its own.
            stored = _named(kept.store, name, whose)
        else:
            stored = [entry.name for entry in kept.store.entries() if entry.name == name]
        if stored:
            yield stored[-1], name


def _bring(store: BackupStore, name: str, target: Path, identity: x25519.Identity | None) -> None:
    with store.open(name) as source, target.open("wb") as stream:
        target.chmod(0o600)
        if not name.endswith(ENDING):
            while piece := source.read(1 << 20):
                stream.write(piece)
        elif identity is None:
            raise InputError(
                f"{name} is encrypted; name its private key's file by --identity or PALPEBRA_BACKUP_IDENTITY"
            )
        else:
            decrypt(source, stream, identity, name)
