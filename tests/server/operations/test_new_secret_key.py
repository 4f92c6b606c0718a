"""A changed secret key: what hung on the old one is carried over by `server database rewrap`."""

import time
from dataclasses import dataclass
from pathlib import Path

import pyotp
import pytest
from sqlalchemy import select, text

from server.accounts import service, signing_in
from server.accounts.audit import Verdict, verify
from server.accounts.credentials import PasswordCheck, secret_of
from server.accounts.identity import Identity
from server.context import Services, open_services
from server.core.errors import ApiError
from server.core.settings import Settings
from server.models import Account
from tests.helpers.admins import wrong_code
from tests.helpers.databases import Called, run_server_command
from tests.helpers.studies import Participant

NEW = "another secret key, as long as they should be"
THIRD = "a third one, and long enough to be one as well"


@dataclass(frozen=True)
class Phone:
    """An account and what its authenticator app holds."""

    name: str
    secret: str

    def code(self, steps: int = 0) -> str:
        """The app's code of this moment, or of so many half minutes later."""
        return pyotp.TOTP(self.secret).at(int(time.time()) + 30 * steps)


def with_phone(services: Services, name: str) -> Phone:
    with services.database.write() as session:
        account = service.create_account(session, name, "correct horse battery", "owner")
    me = Identity(account.id, name, "owner")
    phone = Phone(name, service.start_second_factor(services.database, services.settings, me))
    service.confirm_second_factor(services.database, services.settings, me, phone.code(-1))
    return phone


def failure(services: Services, phone: Phone, code: str) -> ApiError | None:
    with services.database.read() as session:
        stored = session.scalars(select(Account).where(Account.name == phone.name)).one().password_hash
    _, failed = signing_in.open_session(
        services.database, services.settings, services.sign_ins, phone.name, PasswordCheck(stored), code, ""
    )
    return failed


def verdict(services: Services) -> Verdict:
    with services.database.read() as session:
        return verify(session, services.settings.key)


@pytest.fixture
def old_key(tmp_path: Path, settings: Settings) -> Path:
    path = tmp_path / "secret_key.before"
    path.write_bytes(settings.key + b"\n")
    return path


@pytest.fixture
def changed(settings: Settings) -> Settings:
    return settings.model_copy(update={"secret_key": NEW})


@pytest.fixture
def third(settings: Settings) -> Settings:
    """Copied before any key was read: a copy keeps the key that was."""
    return settings.model_copy(update={"secret_key": THIRD})


def rewrap(changed: Settings, old_key: Path) -> Called:
    return run_server_command(changed, "database", "rewrap", str(old_key))


def test_phones_and_the_audit_log_go_on_under_a_new_key(
    services: Services, changed: Settings, old_key: Path
) -> None:
    ada = with_phone(services, "ada")
    before = verdict(services)
    again = open_services(changed)
    # Between the restart with the new key and the command: an entry, and a phone set up under the new key.
    bob = with_phone(again, "bob")
    assert failure(again, ada, ada.code()) is not None
    assert verdict(again).broken is not None
    called = rewrap(changed, old_key)
    assert called.returncode == 0, called.stderr
    assert "1 second factor" in called.stdout
    for phone in (ada, bob):
        assert failure(again, phone, wrong_code(phone.secret)) is not None
        assert failure(again, phone, phone.code(1)) is None
    after = verdict(again)
    assert (after.broken, after.position > before.position) == (None, True)
    # Once more: the old key holds nothing any more, and nothing is spoilt.
    once_more = rewrap(changed, old_key)
    assert once_more.returncode == 2
    assert "nothing" in once_more.stderr
    with again.database.read() as session:
        kept = session.scalars(select(Account).where(Account.name == "ada")).one().totp_secret
    assert secret_of(again.settings.key, kept or "") == ada.secret
    again.database.close()


def test_a_key_that_was_never_this_servers_changes_nothing(
    services: Services, settings: Settings, changed: Settings, tmp_path: Path
) -> None:
    ada = with_phone(services, "ada")
    wrong = tmp_path / "wrong"
    wrong.write_text("some other key")
    called = rewrap(changed, wrong)
    assert (called.returncode, "never" in called.stderr or "nothing" in called.stderr) == (2, True)
    assert failure(services, ada, ada.code()) is None
    assert verdict(services).broken is None


def test_a_log_that_was_tampered_with_is_not_made_whole(
    services: Services, changed: Settings, old_key: Path, participant: Participant
) -> None:
    ada = with_phone(services, "ada")
    with_phone(services, "bob")
    with services.database.write() as session:
        session.execute(text("UPDATE audit_entries SET actor = 'somebody' WHERE position = 3"))
    called = rewrap(changed, old_key)
    assert called.returncode == 2
    assert "entry 3" in called.stderr
    again = open_services(changed)
    assert (
        failure(again, ada, ada.code()) is not None
    )  # only a whole log says which key a phone was set up under
    with services.database.read() as session:
        assert "entry 3" in (verify(session, services.settings.key).broken or "")
    again.database.close()


def test_phones_that_were_carried_over_can_be_again(
    services: Services, changed: Settings, old_key: Path, tmp_path: Path
) -> None:
    ada = with_phone(services, "ada")
    assert rewrap(changed, old_key).returncode == 0
    second = tmp_path / "second"
    second.write_text(NEW)
    third = changed.model_copy(update={"secret_key": THIRD})
    assert rewrap(third, second).returncode == 0
    again = open_services(third)
    assert failure(again, ada, ada.code()) is None
    again.database.close()


def test_a_phone_whose_set_up_is_the_first_entry_under_the_new_key_goes_on(
    services: Services, changed: Settings, old_key: Path
) -> None:
    with services.database.write() as session:
        account = service.create_account(session, "eva", "correct horse battery", "owner")
    again = open_services(changed)
    me = Identity(account.id, "eva", "owner")
    eva = Phone("eva", service.start_second_factor(again.database, again.settings, me))
    service.confirm_second_factor(again.database, again.settings, me, eva.code(-1))
    called = rewrap(changed, old_key)
    assert (called.returncode, "0 second factors" in called.stdout) == (0, True), called.stderr
    assert failure(again, eva, eva.code()) is None
    again.database.close()


def phones_of_two_keys(services: Services, changed: Settings, folder: Path) -> tuple[Phone, Phone, Path]:
    """Ada's, set up under the first key, bob's under the second, and a file with the second."""
    ada = with_phone(services, "ada")
    between = open_services(changed)
    bob = with_phone(between, "bob")
    between.database.close()
    second = folder / "second"
    second.write_text(NEW)
    return ada, bob, second


def test_a_key_that_was_changed_twice_spoils_no_phone_and_is_carried_over_in_two_steps(
    services: Services, changed: Settings, third: Settings, old_key: Path, tmp_path: Path
) -> None:
    ada, bob, second = phones_of_two_keys(services, changed, tmp_path)
    again = open_services(third)
    with_phone(again, "eve")
    for key in (old_key, second):
        called = rewrap(third, key)
        assert (called.returncode, "neither" in called.stderr) == (2, True)
    with again.database.read() as session:
        kept = {row.name: row.totp_secret or "" for row in session.scalars(select(Account))}
    assert secret_of(services.settings.key, kept["ada"]) == ada.secret
    assert secret_of(changed.key, kept["bob"]) == bob.secret
    again.database.close()


def test_two_steps_carry_over_what_was_set_up_under_each_key(
    services: Services, changed: Settings, third: Settings, old_key: Path, tmp_path: Path
) -> None:
    ada, bob, second = phones_of_two_keys(services, changed, tmp_path)
    assert rewrap(changed, old_key).returncode == 0
    assert rewrap(third, second).returncode == 0
    again = open_services(third)
    for phone in (ada, bob):
        assert failure(again, phone, phone.code()) is None
    assert verdict(again).broken is None
    again.database.close()
