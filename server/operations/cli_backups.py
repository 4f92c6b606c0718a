"""`server backup`, `server backup-key`, `server restore` and `server drill`."""

import os
import signal
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from pyrage import x25519

from experiments.errors import InputError, counted
from server.cli_common import out, stored_services
from server.context import open_services
from server.core.settings import Settings
from server.core.values import now
from server.operations import backup as backups
from server.operations import drill as drills
from server.operations import restore as restoring
from server.operations.backup import ENDING, identity_in, make_identity, recipient_of
from server.operations.backup_stores import (
    SCHEME,
    StoredBackup,
    back_up_to,
    backup_store,
    brought_here,
    ending_of,
)
from server.operations.drill import identity_of
from server.operations.watched_backups import newest_backup, superfluous_backups

LOWEST_PRIORITY = 19


def register(parent: typer.Typer) -> None:
    """Add the commands that make backups and bring them back."""
    parent.command("backup")(backup)
    parent.command("backup-key")(backup_key)
    parent.command("restore")(restore)
    parent.command("drill")(drill)


def backup(
    file: Annotated[
        Path | None, typer.Argument(help="The file to write; by default, palpebra-DATE.tar.")
    ] = None,
    without_clips: Annotated[
        bool,
        typer.Option("--without-clips", help="Omit the clips, if their store is backed up separately."),
    ] = False,
    keep: Annotated[
        int,
        typer.Option(
            min=0,
            help=(
                "Keep the last backup of each of the newest DAYS days (and all of the newest day); remove "
                "older palpebra-DATE.tar files in this folder. 0: remove none."
            ),
            metavar="DAYS",
        ),
    ] = 0,
    keys: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Where to write the key file; by default PALPEBRA_BACKUP_KEYS, or palpebra-keys.json next "
                "to the backup."
            )
        ),
    ] = None,
    to: Annotated[
        str,
        typer.Option(
            help=("Encrypt the backup, and write it to this folder or s3://BUCKET/PREFIX instead."),
            metavar="ADDRESS",
        ),
    ] = "",
    recipient: Annotated[
        str,
        typer.Option(help="Public key to encrypt for; by default PALPEBRA_BACKUP_RECIPIENT."),
    ] = "",
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite an existing FILE.")] = False,
) -> None:
    """Back up database, clips and secret key in one file while the server runs.

    The file contains all answers and the secret key: keep it where only you can read it (mode 600), or
    encrypt it for another host with --to. The keys of recruiters' IDs are in palpebra-keys.json, which each
    backup replaces. Keep only the newest copy of it, so that erased people are erased from older backups too.

    The folders of FILE and of the key file must exist.

    Examples:

      server backup backups/palpebra-$(date -u +%FT%H%M%S).tar --keep 14

      server backup-key /media/safe/backups.key

      server backup --to s3://lab-backups/palpebra --recipient age1... --keep 14
    """
    if to and (file is not None or keys is not None):
        raise InputError("expected either a FILE (and --keys) or --to, which includes the key file")
    name = f"palpebra-{now():%Y-%m-%dT%H%M%S}.tar"
    if to:
        _back_up_to(to, recipient, name, with_clips=not without_clips, keep=keep)
        return
    path = file or Path(name)
    if path.exists() and not replace:
        raise InputError(f"{path} already exists; choose another file, or add --replace to overwrite it")
    if not path.parent.exists():
        # A disk that is not mounted leaves a folder that does not exist, either.
        sys.stderr.write(f"note: creates the folder {path.parent.absolute()}, which did not exist\n")
    with stored_services() as services:
        described = backups.back_up(
            services.database,
            services.settings,
            services.clips,
            path,
            with_clips=not without_clips,
            keys=keys or services.settings.backup_keys,
        )
    out.print(f"{path}: {_contents(described)}, {path.stat().st_size / 1e6:.1f} MB")
    for old in superfluous_backups(path.parent.glob("palpebra-*.tar"), keep) if keep else ():
        old.unlink()
        out.print(f"removed {old}")


def _contents(described: backups.Description) -> str:
    rows = sum(table.rows for table in described.tables.values())
    return f"{counted(rows, 'row')}, {counted(len(described.clips), 'clip')}"


def _back_up_to(to: str, recipient: str, name: str, *, with_clips: bool, keep: int) -> None:
    settings = Settings()
    public = recipient or settings.backup_recipient
    if not public:
        raise InputError(
            "expected a public key to encrypt for (--recipient or PALPEBRA_BACKUP_RECIPIENT); create one "
            "with: server backup-key FILE"
        )
    key = recipient_of(public)
    store = backup_store(to, settings)
    with stored_services(settings) as services:
        kept_as, described = back_up_to(
            services.database, services.settings, services.clips, store, name, key, with_clips=with_clips
        )
        ending = ending_of(settings.key)
    out.print(f"{store.address}/{kept_as}: {_contents(described)}, encrypted")
    ours = [Path(entry.name) for entry in store.entries() if entry.name.endswith(ending)]
    for old in superfluous_backups(ours, keep) if keep else ():
        store.remove(old.name)
        out.print(f"removed {old.name}")


def backup_key(
    file: Annotated[Path, typer.Argument(help="Where to write the private key.", show_default=False)],
) -> None:
    """Create a key pair for encrypted backups, and print the public key.

    Set PALPEBRA_BACKUP_RECIPIENT to the public key. Keep the private key off the server, in two safe places:
    without it no backup can be read. It is an age key (age-encryption.org); `age -d -i FILE` reads backups.
    Example: server backup-key /media/safe/backups.key
    """
    public = make_identity(file)
    out.print(public)


File = Annotated[
    str,
    typer.Argument(help="A file from `server backup`, or s3://BUCKET/PREFIX/NAME.", show_default=False),
]
IdentityFile = Annotated[
    Path | None,
    typer.Option("--identity", help="File of the private key; by default PALPEBRA_BACKUP_IDENTITY."),
]
KeyFile = Annotated[
    Path | None,
    typer.Option(
        "--keys",
        help=(
            "The key file; by default PALPEBRA_BACKUP_KEYS (for unencrypted backups), or "
            "palpebra-keys.json next to the backup."
        ),
    ),
]


def restore(
    file: File,
    keys: KeyFile = None,
    identity: IdentityFile = None,
    stale_keys: Annotated[
        bool,
        typer.Option(
            "--stale-keys",
            help="Use a key file that is older than the backup: recruiters' IDs of later visits are lost.",
        ),
    ] = False,
    despite_erasures: Annotated[
        bool,
        typer.Option(
            "--despite-erasures",
            help=(
                "Restore without a ledger of erasures newer than the backup: data erased since then come "
                "back."
            ),
        ),
    ] = False,
) -> None:
    """Restore a backup into an empty database (SQLite or PostgreSQL) and clip store.

    Stop the server first; the database in the settings must be empty. Counts and hashes are verified. People
    who were erased since the backup are erased again, by the ledger of erasures (erasures.ndjson) next to the
    backup or in the data folder.

    Examples:

      DATABASE_URL=postgresql://me@host/new server restore backups/monday.tar

      server restore s3://lab/palpebra/palpebra-2026-01-31T030000.tar.age --identity backups.key
    """
    settings = Settings()
    services = open_services(settings)
    try:
        with ExitStack() as held:
            path = _in_the_open(file, settings, _private_key(settings, identity), held)
            plain = not file.endswith(ENDING)
            keys = keys or (settings.backup_keys if plain else None)
            described = restoring.restore(
                services.database,
                services.settings,
                services.clips,
                path,
                out.print,
                keys=keys,
                stale_keys=stale_keys,
                despite_erasures=despite_erasures,
            )
    finally:
        services.database.close()
    out.print(f"restored the backup of {described.created_at}")


def _in_the_open(file: str, settings: Settings, identity: x25519.Identity | None, held: ExitStack) -> Path:
    """The backup as a file of this machine; what was decrypted is removed when `held` ends."""
    if not file.startswith(SCHEME) and not file.endswith(ENDING):
        return Path(file)
    folder, _, name = file.rpartition("/")
    settings.data_folder.mkdir(parents=True, exist_ok=True)
    beside = held.enter_context(tempfile.TemporaryDirectory(prefix=".restore-", dir=settings.data_folder))
    kept = StoredBackup(backup_store(folder or ".", settings), name)
    return held.enter_context(brought_here(kept, Path(beside), identity))


def _private_key(settings: Settings, identity: Path | None) -> x25519.Identity | None:
    return identity_in(identity) if identity is not None else identity_of(settings)


def drill(
    file: Annotated[
        str,
        typer.Argument(help="A backup, a folder or s3://BUCKET/PREFIX; by default PALPEBRA_BACKUP_FOLDER."),
    ] = "",
    when_due: Annotated[
        bool,
        typer.Option(
            "--when-due", help="Run only if the last drill is at least a week old (a day if it failed)."
        ),
    ] = False,
    identity: IdentityFile = None,
    keys: KeyFile = None,
) -> None:
    """Test the newest backup: restore it to a temporary place, check it and remove it; exit code 1 on
    failure.

    The data of the server are not touched. If PALPEBRA_BACKUP_FOLDER is set, the server runs this drill every
    week; /metrics and `server doctor` report the last result. Encrypted backups need their private key.

    Examples:

      server drill backups

      server drill s3://lab-backups/palpebra --identity backups.key
    """
    settings = Settings()
    if when_due:
        os.nice(LOWEST_PRIORITY)  # raters come first
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the copy is removed
        result = drills.drill_when_due(settings)
        if result is None:
            out.print("no drill is due")
            return
    else:
        key = _private_key(settings, identity)
        chosen = _backup_of(file or str(settings.backup_folder), settings)
        result = drills.drill(settings, chosen, key, keys)
    if not result.passed:
        out.print(f"{result.backup}: the drill failed: {result.said}")
        raise typer.Exit(1)
    out.print(
        f"{result.backup} was restored completely: {counted(result.rows, 'row')}, "
        f"{counted(result.clips, 'clip')} of {result.backed_up_at}, in {result.seconds:.0f} s"
    )


def _backup_of(address: str, settings: Settings) -> Path | StoredBackup:
    """The file itself, or the newest of a folder or bucket."""
    if not address:
        raise InputError(
            "expected a backup or a folder of backups; specify one, or set PALPEBRA_BACKUP_FOLDER"
        )
    if Path(address).is_file() and not address.endswith(ENDING):
        return Path(address)
    if address.endswith((".tar", ENDING)):
        folder, _, name = address.rpartition("/")
        store = backup_store(folder or ".", settings)
        backup = next((StoredBackup(store, one.name) for one in store.entries() if one.name == name), None)
    else:
        backup = newest_backup(backup_store(address, settings))
    if backup is None:
        raise InputError(f"{address}: expected a backup, or a folder with palpebra-*.tar; run: server backup")
    return backup
