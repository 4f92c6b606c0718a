"""Key file and backup belong together: one installation, no older than the backup, never put back."""

import io
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, cast

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from experiments.errors import InputError
from server.context import Services, open_services
from server.core.settings import Settings
from server.core.storage import ClipStore
from server.models import IdentityKey, Study, StudyRun
from server.operations import key_escrow
from server.operations.backup import back_up, decrypt, identity_in, make_identity, recipient_of
from server.operations.backup_stores import FolderOfBackups, StoredBackup, back_up_to, backups_in
from server.operations.drill import drill, drill_when_due
from server.operations.key_escrow import NAME, key_file
from server.operations.restore import restore
from server.participation.identity_repository import known_as
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant, StudyInDatabase

pytestmark = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
TAR = "palpebra-2026-03-01T030000.tar"


@pytest.fixture
def link(study: StudyInDatabase) -> str:
    return study.link(recruiter={"kind": "sona"})


@pytest.fixture
def first(client: TestClient, link: str) -> Participant:
    return came(client, link, "40177")


@pytest.fixture
def safe(tmp_path: Path) -> tuple[str, Path]:
    """Public key of encrypted backups, and the file of the private one."""
    path = tmp_path / "safe.key"
    return make_identity(path), path


def came(client: TestClient, link: str, code: str) -> Participant:
    person = Participant(client, link)
    person.start(query={"survey_code": code})
    return person


def erase(experimenter: Admin, run: str) -> None:
    assert experimenter.send("POST", f"/studies/short/runs/{run}/erase", {"confirm": run}).status_code == 200


def empty(folder: Path) -> Services:
    return open_services(Settings(database_url=f"sqlite:///{folder / 'x.sqlite'}", data_folder=folder))


def ids(services: Services) -> list[str]:
    with services.database.read() as session:
        known = [known_as(session, run) for run in session.scalars(select(StudyRun).order_by(StudyRun.id))]
    return [person.identifier for person in known if person]


def with_secret(services: Services, secret: str) -> Services:
    return open_services(Settings(**services.settings.model_dump() | {"secret_key": secret}))


class DuringTheClips:
    """The clip store, which does something once before its first clip is read for a backup."""

    def __init__(self, clips: ClipStore, event: Callable[[], None]) -> None:
        self._clips, self._event = clips, iter([event])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._clips, name)

    def read(self, sha256: str, start: int, size: int) -> Iterator[bytes]:
        for event in self._event:
            event()
        return self._clips.read(sha256, start, size)


def overtaken(clips: ClipStore, event: Callable[[], None]) -> ClipStore:
    """A clip store by which the next backup is overtaken by an event, after its rows and before its clips."""
    return cast(ClipStore, DuringTheClips(clips, event))


def test_a_key_file_older_than_the_backup_fails_drill_and_restore(
    services: Services, client: TestClient, link: str, first: Participant, tmp_path: Path
) -> None:
    folder = tmp_path / "b"
    folder.mkdir()
    back_up(services.database, services.settings, services.clips, folder / "older.tar", with_clips=False)
    shutil.copy(folder / NAME, tmp_path / "stale.json")
    came(client, link, "40178")
    back_up(services.database, services.settings, services.clips, folder / "newer.tar", with_clips=False)
    assert drill(services.settings, folder / "newer.tar").said == ""
    assert drill(services.settings, folder / "older.tar").said == "", "a newer key file is by design"
    shutil.copy(tmp_path / "stale.json", folder / NAME)
    result = drill(services.settings, folder / "newer.tar")
    assert not result.passed
    assert "is older than the backup" in result.said
    new = tmp_path / "new"
    arguments = ("restore", "--despite-erasures", str(folder / "newer.tar"))
    target = empty(new)
    with pytest.raises(InputError, match="is older than the backup"):
        restore(target.database, target.settings, target.clips, folder / "newer.tar", despite_erasures=True)
    target.database.close()
    refused = run_server_command(target.settings, *arguments)
    assert refused.returncode == 2
    assert len(refused.stderr.strip().splitlines()) == 1, "nothing was written before"
    assert "--stale-keys" in refused.stderr
    done = run_server_command(target.settings, *arguments, "--stale-keys")
    assert "1 recruiters' IDs; the keys of 1 no longer exist" in done.stdout, done.stderr


@pytest.mark.parametrize("kind", ["here", "off the host"])
def test_the_keys_are_there_before_the_backup(
    services: Services, first: Participant, safe: tuple[str, Path], kind: str, tmp_path: Path
) -> None:
    """Whenever it is killed: no backup without its keys."""
    seen: list[set[str]] = []

    class Watched(FolderOfBackups):
        def put(self, name: str, stream: IO[bytes]) -> None:
            super().put(name, stream)
            seen.append({entry.name for entry in self.entries()})

    if kind == "here":
        (tmp_path / "b").mkdir()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(key_escrow, "write_keys", _killed)
            with pytest.raises(KeyboardInterrupt):
                back_up(services.database, services.settings, services.clips, tmp_path / "b" / TAR)
        assert list((tmp_path / "b").glob("*.tar")) == []
        return
    back_up_to(
        services.database,
        services.settings,
        services.clips,
        Watched(tmp_path / "b"),
        TAR,
        recipient_of(safe[0]),
    )
    for names in seen:
        if any(name.endswith(".tar.age") for name in names):
            assert any(name.startswith("palpebra-keys-") for name in names)
    assert len(seen[-1]) == 3  # and the ledger of erasures


def _killed(*_arguments: object) -> None:
    raise KeyboardInterrupt


def test_a_backup_that_is_overtaken_brings_no_key_back(
    services: Services,
    experimenter: Admin,
    client: TestClient,
    link: str,
    first: Participant,
    tmp_path: Path,
) -> None:
    folder = tmp_path / "b"
    folder.mkdir()

    def event() -> None:
        erase(experimenter, first.run_id)
        came(client, link, "40178")
        back_up(services.database, services.settings, services.clips, folder / "second.tar")

    back_up(
        services.database,
        services.settings,
        overtaken(services.clips, event),
        folder / "first.tar",
    )
    with services.database.read() as session:
        runs = set(session.scalars(select(StudyRun.public_id).join(IdentityKey)))
    assert len(runs) == 1
    assert set(key_file(folder / NAME).runs) == runs
    assert drill(services.settings, folder / "second.tar").said == ""


def test_one_that_is_overtaken_off_the_host_brings_no_key_back(
    services: Services,
    experimenter: Admin,
    client: TestClient,
    link: str,
    first: Participant,
    safe: tuple[str, Path],
    tmp_path: Path,
) -> None:
    store, public = FolderOfBackups(tmp_path / "b"), recipient_of(safe[0])

    def event() -> None:
        erase(experimenter, first.run_id)
        came(client, link, "40178")
        back_up_to(
            services.database,
            services.settings,
            services.clips,
            store,
            "palpebra-2026-03-02T030000.tar",
            public,
        )

    back_up_to(
        services.database,
        services.settings,
        overtaken(services.clips, event),
        store,
        TAR,
        public,
    )
    [keys] = [entry.name for entry in store.entries() if entry.name.startswith("palpebra-keys-")]
    target = io.BytesIO()
    with store.open(keys) as source:
        decrypt(source, target, identity_in(safe[1]), keys)
    assert first.run_id not in target.getvalue().decode()
    for backup in backups_in(store):
        result = drill(services.settings, StoredBackup(store, backup.name), identity_in(safe[1]))
        assert result.said == ""


def test_a_key_file_of_the_future_is_replaced(
    services: Services, first: Participant, experimenter: Admin, tmp_path: Path
) -> None:
    """A clock that was wrong once does not keep erasures from older backups for ever."""
    back_up(services.database, services.settings, services.clips, tmp_path / "a.tar", with_clips=False)
    keys = key_file(tmp_path / NAME).model_copy(update={"written_at": "2999-01-01T00:00:00.000000Z"})
    (tmp_path / NAME).write_text(keys.model_dump_json())
    erase(experimenter, first.run_id)
    back_up(services.database, services.settings, services.clips, tmp_path / "b.tar", with_clips=False)
    assert key_file(tmp_path / NAME).runs == {}


def test_a_restore_takes_no_keys_of_another_installation(
    services: Services, first: Participant, tmp_path: Path
) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    back_up(services.database, services.settings, services.clips, tmp_path / "a" / TAR, with_clips=False)
    other = with_secret(services, "another installation of this machine")
    back_up(other.database, other.settings, other.clips, tmp_path / "b" / TAR, with_clips=False)
    other.database.close()
    target = empty(tmp_path / "new")
    with pytest.raises(InputError, match="belongs to another installation or secret key than the backup"):
        restore(
            target.database,
            target.settings,
            target.clips,
            tmp_path / "a" / TAR,
            keys=tmp_path / "b" / NAME,
            despite_erasures=True,
        )
    target.database.close()
    again = run_server_command(
        target.settings,
        "restore",
        "--despite-erasures",
        str(tmp_path / "a" / TAR),
        "--keys",
        str(tmp_path / "a" / NAME),
    )
    assert "1 recruiters' IDs; the keys of 0 no longer exist" in again.stdout, again.stderr


def test_after_a_change_of_the_secret_key_older_backups_keep_their_keys(
    services: Services, first: Participant, tmp_path: Path
) -> None:
    folder, old = tmp_path / "b", tmp_path / "old_key"
    folder.mkdir()
    back_up(services.database, services.settings, services.clips, folder / "older.tar", with_clips=False)
    old.write_bytes(services.settings.key)
    changed = with_secret(services, "another key of this installation")
    done = run_server_command(changed.settings, "database", "rewrap", str(old))
    assert "to the existing backups" in done.stdout, done.stderr
    shutil.move(folder / NAME, folder / "keys-of-before.json")
    back_up(changed.database, changed.settings, changed.clips, folder / "newer.tar", with_clips=False)
    target = empty(tmp_path / "new")
    with pytest.raises(InputError, match="another installation or secret key than the backup"):
        restore(target.database, target.settings, target.clips, folder / "older.tar", despite_erasures=True)
    restore(
        target.database,
        target.settings,
        target.clips,
        folder / "older.tar",
        keys=folder / "keys-of-before.json",
    )
    assert ids(target) == ["40177"]
    with target.database.read() as one, services.database.read() as two:
        query = select(Study.pseudonym_key)
        assert one.scalars(query).all() == two.scalars(query).all()
    target.database.close()
    changed.database.close()


def test_two_installations_share_a_store_without_the_private_key(
    services: Services, first: Participant, safe: tuple[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "b"
    store, public = FolderOfBackups(folder), recipient_of(safe[0])
    for day in (1, 2):
        back_up_to(
            services.database,
            services.settings,
            services.clips,
            store,
            f"palpebra-2026-01-0{day}T030000.tar",
            public,
            with_clips=False,
        )
    ours = {entry.name for entry in store.entries()}
    other = with_secret(services, "another installation of this machine")
    made = run_server_command(
        other.settings, "backup", "--to", str(folder), "--recipient", safe[0], "--keep", "1"
    )
    assert "removed" not in made.stdout, made.stderr
    assert ours < {entry.name for entry in store.entries()}
    other.database.close()
    backup = next(name for name in ours if name.startswith("palpebra-2026-01-02"))
    target = empty(tmp_path / "new")
    done = run_server_command(
        target.settings, "restore", "--despite-erasures", str(folder / backup), "--identity", str(safe[1])
    )
    assert "1 recruiters' IDs; the keys of 0 no longer exist" in done.stdout, done.stderr
    target.database.close()


def test_a_plain_and_an_encrypted_backup_in_one_folder_have_their_own_keys(
    services: Services,
    client: TestClient,
    link: str,
    first: Participant,
    safe: tuple[str, Path],
    tmp_path: Path,
) -> None:
    store = FolderOfBackups(tmp_path / "b")
    back_up_to(
        services.database,
        services.settings,
        services.clips,
        store,
        TAR,
        recipient_of(safe[0]),
        with_clips=False,
    )
    [encrypted] = backups_in(store)
    came(client, link, "40178")
    back_up(
        services.database,
        services.settings,
        services.clips,
        tmp_path / "b" / "palpebra-2026-03-02.tar",
        with_clips=False,
    )
    for name in (encrypted.name, "palpebra-2026-03-02.tar"):
        assert drill(services.settings, StoredBackup(store, name), identity_in(safe[1])).said == ""
    # The plain one needs no private key for a key file that is not its own.
    assert drill(services.settings, StoredBackup(store, "palpebra-2026-03-02.tar")).said == ""


def test_the_weekly_drill_knows_where_the_key_file_is(
    services: Services, first: Participant, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    keys = tmp_path / "safe" / "keys.json"
    for folder in (keys.parent, tmp_path / "b"):
        folder.mkdir()
    monkeypatch.setenv("PALPEBRA_BACKUP_KEYS", str(keys))
    settings = Settings(
        **services.settings.model_dump() | {"backup_folder": str(tmp_path / "b"), "backup_keys": keys}
    )
    made = run_server_command(settings, "backup", str(tmp_path / "b" / TAR))
    assert made.returncode == 0, made.stderr
    assert keys.exists()
    assert not (tmp_path / "b" / NAME).exists()
    result = drill_when_due(settings)
    assert result is not None
    assert (result.passed, result.said) == (True, "")
    monkeypatch.delenv("PALPEBRA_BACKUP_KEYS")
    unset = Settings(**settings.model_dump() | {"backup_keys": None})
    told = run_server_command(unset, "drill", str(tmp_path / "b"))
    assert told.returncode == 1
    assert "PALPEBRA_BACKUP_KEYS" in told.stdout
    named = run_server_command(unset, "drill", str(tmp_path / "b"), "--keys", str(keys))
    assert named.returncode == 0, named.stdout
