"""Encrypted backups in a folder and a bucket: whole or absent, opened by their key alone, brought back."""

import io
import os
import re
import stat
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import IO

import pyrage
import pytest
from fastapi.testclient import TestClient

from experiments.errors import InputError
from server.context import Services, open_services
from server.core.settings import Settings
from server.core.values import now
from server.operations import watched_backups as watching
from server.operations.backup import (
    back_up,
    decrypt,
    encrypted_stream,
    identity_in,
    make_identity,
    recipient_of,
)
from server.operations.backup_stores import (
    BackupStore,
    StoredBackup,
    back_up_to,
    backup_store,
    backups_in,
    ending_of,
)
from server.operations.doctor import backups
from server.operations.drill import drill, drill_when_due
from server.operations.metrics import exposition
from server.operations.watched_backups import OLD_AFTER_S, WatchedBackups, last_drill, watched_backups
from tests.helpers.admins import Admin
from tests.helpers.databases import Called, run_server_command
from tests.helpers.studies import Participant, StudyInDatabase

pytestmark = [
    pytest.mark.parametrize("database_url", ["sqlite"], indirect=True),
    # boto3 announces the end of its support for this Python; requirements say 3.11.
    pytest.mark.filterwarnings("ignore::boto3.exceptions.PythonDeprecationWarning"),
    pytest.mark.filterwarnings("ignore:datetime.datetime.utcnow:DeprecationWarning"),
]
BACKUP, BUCKET, CODE = "palpebra-2026-03-01T030000.tar", "lab-backups", "40177"


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    moto = pytest.importorskip("moto.server", reason="moto is not installed")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def bucket(endpoint: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """The address of a prefix of a bucket, at a real server of S3's protocol."""
    boto3 = pytest.importorskip("boto3", reason="the extra s3 is not installed")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("PALPEBRA_S3_ENDPOINT", endpoint)
    boto3.client("s3", endpoint_url=endpoint, region_name="us-east-1").create_bucket(Bucket=BUCKET)
    return f"s3://{BUCKET}/{tmp_path.name}"


@pytest.fixture
def keys(tmp_path: Path) -> tuple[str, Path]:
    """Public key, and the file of the private one."""
    path = tmp_path / "safe.key"
    return make_identity(path), path


@pytest.fixture
def rated(client: TestClient, services: Services, study: StudyInDatabase) -> Services:
    """Somebody with a recruiter's ID has rated."""
    person = Participant(client, study.link(recruiter={"kind": "sona"}))
    person.start(query={"survey_code": CODE})
    person.request("PUT", "/consent", {"agreed": True})
    person.rate_all()
    return services


def backed_up(services: Services, store: BackupStore, public: str, name: str = BACKUP) -> StoredBackup:
    kept_as, _ = back_up_to(
        services.database, services.settings, services.clips, store, name, recipient_of(public)
    )
    return StoredBackup(store, kept_as)


def test_a_bucket_gets_it_encrypted_and_it_comes_back(
    rated: Services, bucket: str, endpoint: str, keys: tuple[str, Path], tmp_path: Path
) -> None:
    public, private = keys
    made = run_server_command(rated.settings, "backup", "--to", bucket, "--recipient", public)
    assert made.returncode == 0, made.stderr
    assert made.stdout.startswith(f"{bucket}/palpebra-")
    store = backup_store(bucket, Settings(s3_endpoint=endpoint))
    [entry] = backups_in(store)
    ledger_name, keys_name = sorted({one.name for one in store.entries()} - {entry.name})
    assert re.fullmatch(r"palpebra-keys-.*\.json\.age", keys_name)
    assert re.fullmatch(r"erasures-.*\.ndjson\.age", ledger_name)
    new = Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}", data_folder=tmp_path / "new")
    address = f"{bucket}/{entry.name}"
    refused = run_server_command(new, "restore", address)
    assert refused.returncode == 2
    assert "is encrypted; specify the file of its private key" in refused.stderr
    done = run_server_command(new, "restore", address, "--identity", str(private), "--despite-erasures")
    assert done.returncode == 0, done.stderr
    assert "1 recruiters' IDs; the keys of 0 no longer exist" in done.stdout
    again = open_services(new)
    with again.database.read() as one, rated.database.read() as other:
        count = "SELECT count(*) FROM trial_ratings"
        assert one.connection().exec_driver_sql(count).scalar() == 12
        assert other.connection().exec_driver_sql(count).scalar() == 12
    again.database.close()
    assert not list(new.data_folder.glob(".restore-*"))


def test_who_is_erased_since_is_erased_again_from_an_older_one(
    rated: Services, experimenter: Admin, keys: tuple[str, Path], tmp_path: Path
) -> None:
    store = backup_store(str(tmp_path / "elsewhere"), rated.settings)
    older = backed_up(rated, store, keys[0])
    run = experimenter.get("/studies/short/runs").json()["runs"][0]["run"]
    experimenter.send("POST", f"/studies/short/runs/{run}/erase", {"confirm": run})
    backed_up(rated, store, keys[0], "palpebra-2026-03-02T030000.tar")
    new = Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}", data_folder=tmp_path / "new")
    address = str(tmp_path / "elsewhere" / older.name)
    done = run_server_command(new, "restore", address, "--identity", str(keys[1]), "--despite-erasures")
    assert "1 run erased again" in done.stdout, done.stderr
    assert "0 recruiters' IDs; the keys of 1 no longer exist" in done.stdout


def test_a_drill_of_a_bucket(
    rated: Services, bucket: str, endpoint: str, keys: tuple[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    public, private = keys
    settings = Settings(
        **rated.settings.model_dump()
        | {"backup_folder": bucket, "s3_endpoint": endpoint, "backup_recipient": public}
    )
    kept = backed_up(rated, backup_store(bucket, settings), public)
    assert drill_when_due(settings) is None, "without the private key it is for another machine"
    [_, finding] = backups(open_services(settings))
    assert (finding.verdict, finding.state) == ("warning", "not here")
    with_key = Settings(**settings.model_dump() | {"backup_identity": private})
    result = drill_when_due(with_key)
    assert result is not None
    assert (result.passed, result.said, result.backup) == (True, "", kept.name)
    assert result.rows > 10
    assert last_drill(settings) == result
    assert not list(settings.data_folder.glob(".drill-*"))
    assert drill_when_due(with_key) is None
    text = exposition(rated.database, settings).decode()
    assert "palpebra_backups 1.0" in text
    assert "palpebra_restore_drill_passed 1.0" in text
    assert "palpebra_backup_age_seconds" in text


def test_metrics_ask_a_bucket_now_and_then_and_outlive_its_absence(
    rated: Services, bucket: str, endpoint: str, keys: tuple[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Settings(**rated.settings.model_dump() | {"backup_folder": bucket, "s3_endpoint": endpoint})
    store = backup_store(bucket, settings)
    kept = backed_up(rated, store, keys[0])
    assert watched_backups(settings).number == 1  # type: ignore[union-attr]
    store.remove(kept.name)
    assert watched_backups(settings).number == 1, "kept for a while"  # type: ignore[union-attr]
    monkeypatch.setattr(watching, "ASK_AGAIN_S", 0.0)
    assert watched_backups(settings).number == 0  # type: ignore[union-attr]
    gone = Settings(**settings.model_dump() | {"backup_folder": "s3://there-is-none/x"})
    assert b"palpebra_backups_reachable 0.0" in exposition(rated.database, gone)
    [finding] = backups(open_services(gone))
    assert finding.verdict == "failed"
    assert "the object store refused" in finding.state


def test_what_leaves_the_host_opens_with_the_private_key_alone(
    rated: Services, keys: tuple[str, Path], tmp_path: Path
) -> None:
    public, private = keys
    folder = tmp_path / "elsewhere"
    backed_up(rated, backup_store(str(folder), rated.settings), public)
    plain = tmp_path / "plain.tar"
    back_up(rated.database, rated.settings, rated.clips, plain)
    for path in folder.iterdir():
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        content = path.read_bytes()
        assert content.startswith(b"age-encryption.org/v1\n")
        for secret in (rated.settings.key, b"trial_ratings", b"backup.json", b'"runs"'):
            assert secret not in content
        with pytest.raises(pyrage.DecryptError):
            pyrage.decrypt(content, [pyrage.x25519.Identity.generate()])
        target = io.BytesIO()
        decrypt(io.BytesIO(content), target, identity_in(private), path.name)
        assert any(part in target.getvalue() for part in (b"backup.json", b'"runs"', b"known_until"))


@pytest.mark.parametrize("change", ["cut", "changed", "another key", "keys missing"])
def test_a_damaged_one_fails_its_drill_with_a_reason(
    rated: Services, keys: tuple[str, Path], change: str, tmp_path: Path
) -> None:
    public, private = keys
    folder = tmp_path / "elsewhere"
    kept = backed_up(rated, backup_store(str(folder), rated.settings), public)
    path, key = folder / kept.name, identity_in(private)
    content = path.read_bytes()
    if change == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif change == "changed":
        path.write_bytes(content[:-200] + bytes([content[-200] ^ 1]) + content[-199:])
    elif change == "another key":
        key = pyrage.x25519.Identity.generate()
    else:
        [key_file] = folder.glob("palpebra-keys-*.age")
        key_file.unlink()
    result = drill(rated.settings, kept, key)
    assert not result.passed
    assert ("no key file" if change == "keys missing" else "cannot be decrypted") in result.said
    assert "\n" not in result.said
    assert not list(rated.settings.data_folder.glob(".drill-*"))


@pytest.mark.parametrize("kind", ["folder", "bucket"])
def test_a_backup_that_breaks_off_leaves_nothing_and_says_why(
    rated: Services, kind: str, bucket: str, endpoint: str, keys: tuple[str, Path], tmp_path: Path
) -> None:
    address = bucket if kind == "bucket" else str(tmp_path / "elsewhere")
    store = backup_store(address, Settings(s3_endpoint=endpoint))

    def write(stream: IO[bytes]) -> None:
        stream.write(os.urandom(1 << 20) * 24)  # more than one part of an upload
        raise InputError("the disk of the database went away")

    with (
        pytest.raises(InputError, match="the disk of the database went away"),
        encrypted_stream(write, recipient_of(keys[0])) as stream,
    ):
        store.put("palpebra-2026-03-01.tar.age", stream)
    assert store.entries() == []


def test_another_installations_backups_say_nothing_of_ones_own(
    rated: Services, keys: tuple[str, Path], tmp_path: Path
) -> None:
    """The newest copy in a shared store may come from another server; one that stopped must show."""
    public, private = keys
    folder = tmp_path / "shared"
    settings = Settings(
        **rated.settings.model_dump()
        | {"backup_folder": str(folder), "backup_recipient": public, "backup_identity": private}
    )
    own = backed_up(rated, backup_store(str(folder), settings), public)
    old = (now() - timedelta(days=9)).timestamp()
    os.utime(folder / own.name, (old, old))
    (folder / f"palpebra-2026-01-02T030000{ending_of(b'of another installation')}").touch()
    watched = watched_backups(settings)
    assert watched is not None
    assert (watched.number, watched.newest) == (1, own.name)
    assert watched.age_s is not None
    assert watched.age_s > OLD_AFTER_S
    drilled = drill_when_due(settings)
    assert drilled is not None
    assert (drilled.backup, drilled.passed) == (own.name, True)
    (folder / own.name).unlink()
    assert watched_backups(settings) == WatchedBackups(0, None, None, drilled)


def test_days_are_kept_in_a_store_too(rated: Services, keys: tuple[str, Path], tmp_path: Path) -> None:
    folder, ending = tmp_path / "elsewhere", ending_of(rated.settings.key)
    store = backup_store(str(folder), rated.settings)
    folder.mkdir()
    for day in (1, 2, 3):
        (folder / f"palpebra-2026-01-0{day}T030000{ending}").touch()
    (folder / "palpebra-of-the-move.tar.age").touch()
    made = run_server_command(
        rated.settings, "backup", "--to", str(folder), "--recipient", keys[0], "--keep", "2"
    )
    assert made.stdout.count("removed") == 2, made.stderr
    left = {entry.name for entry in store.entries()}
    assert {"palpebra-of-the-move.tar.age", f"palpebra-2026-01-03T030000{ending}"} < left
    assert len(left) == 5


def test_the_plain_folder_of_before_is_drilled_as_before(rated: Services, tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    back_up(rated.database, rated.settings, rated.clips, tmp_path / "b" / "palpebra-2026-03-01.tar")
    called = run_server_command(rated.settings, "drill", str(tmp_path / "b"))
    assert "was restored completely" in called.stdout, called.stderr


class TestInOneLine:
    def called(self, settings: Settings, *arguments: str) -> Called:
        done = run_server_command(settings, *arguments)
        assert done.returncode != 0
        assert "Traceback" not in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        return done

    @pytest.mark.parametrize(
        ("arguments", "said"),
        [
            (("--to", "x"), "expected a public key to encrypt for"),
            (("--to", "x", "--recipient", "age1no"), "expected a public key age1..."),
            (
                ("--to", "ftp://x", "--recipient", "KEY"),
                "expected a folder or s3://BUCKET/PREFIX, got 'ftp://x'",
            ),
            (("--to", "s3://", "--recipient", "KEY"), "expected s3://BUCKET/PREFIX"),
            (("b.tar", "--to", "x"), "expected either a FILE"),
        ],
    )
    def test_of_backups(
        self, rated: Services, keys: tuple[str, Path], arguments: tuple[str, ...], said: str
    ) -> None:
        given = tuple(keys[0] if one == "KEY" else one for one in arguments)
        assert said in self.called(rated.settings, "backup", *given).stderr

    def test_of_a_store_that_cannot_be_written(
        self, rated: Services, keys: tuple[str, Path], tmp_path: Path
    ) -> None:
        (tmp_path / "file").touch()
        said = self.called(rated.settings, "backup", "--to", str(tmp_path / "file"), "--recipient", keys[0])
        assert "cannot be written" in said.stderr

    def test_of_a_bucket_that_is_not_there(
        self, rated: Services, bucket: str, keys: tuple[str, Path]
    ) -> None:
        said = self.called(rated.settings, "backup", "--to", "s3://there-is-none", "--recipient", keys[0])
        assert "the object store refused the request or did not respond" in said.stderr

    def test_of_keys(self, rated: Services, keys: tuple[str, Path], tmp_path: Path) -> None:
        again = self.called(rated.settings, "backup-key", str(keys[1]))
        assert "already exists" in again.stderr
        made = run_server_command(rated.settings, "backup-key", str(tmp_path / "second.key"))
        assert made.stdout.startswith("age1")
        assert stat.S_IMODE((tmp_path / "second.key").stat().st_mode) == 0o600
        (tmp_path / "none.key").write_text("hello\n")
        for name, said in (("none.key", "AGE-SECRET-KEY"), ("absent.key", "cannot be read")):
            done = self.called(rated.settings, "drill", str(tmp_path), "--identity", str(tmp_path / name))
            assert said in done.stderr


def test_the_admin_page_shows_how_backups_are(
    rated: Services, owner: Admin, experimenter: Admin, keys: tuple[str, Path], tmp_path: Path
) -> None:
    assert experimenter.get("/backups").status_code == 403
    assert owner.get("/backups").json()["watched"] is False
    object.__setattr__(rated.settings, "backup_folder", str(tmp_path / "elsewhere"))
    kept = backed_up(rated, backup_store(str(tmp_path / "elsewhere"), rated.settings), keys[0])
    told = owner.get("/backups").json()
    assert (told["watched"], told["number"], told["newest"]) == (True, 1, kept.name)
    assert told["age_hours"] < 1
    assert told["drill"] is None
    assert told["drilled_elsewhere"] is True
    drill(rated.settings, kept)
    told = owner.get("/backups").json()["drill"]
    assert told["passed"] is False
    assert "is encrypted" in told["said"]
