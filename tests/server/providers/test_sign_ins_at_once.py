"""Sign-ins by a provider at the same moment, and those that wait; a given subject is whom it recognised."""

import threading
import time
from collections.abc import Callable

import pyotp
import pytest
from sqlalchemy import text

from server.accounts import provider_sign_in, signing_in, workspaces
from server.accounts import repository as accounts
from server.accounts import service as account_service
from server.accounts.identity import OPERATOR, Identity
from server.accounts.provider_protocol import NotRecognised, ProviderIdentity
from server.context import Services
from server.core.errors import ApiError
from server.core.settings import Provider, RoleRule, Settings
from server.core.values import now
from server.models import LoginAttempt

on_postgres = pytest.mark.parametrize("database_url", ["postgres"], indirect=True)
VISION = RoleRule(workspace="vision", role="owner", claim="groups", value="vision-lab")
MOTION = RoleRule(workspace="motion", role="viewer", claim="groups", value="vision-lab")
WAITING = text(
    "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND wait_event_type = 'Lock'"
)
PATIENCE_S = 60.0


@pytest.fixture
def settings(settings: Settings) -> Settings:
    uni = Provider(
        label="The University", issuer="https://uni.example", client_id="palpebra", roles=(VISION, MOTION)
    )
    return settings.model_copy(update={"oidc": {"uni": uni}})


@pytest.fixture(autouse=True)
def both_workspaces(services: Services) -> None:
    with services.database.write() as session:
        workspaces.create(session, "vision", "Vision laboratory", OPERATOR)
        workspaces.create(session, "motion", "Motion laboratory", OPERATOR)


def recognised(subject: str, *groups: str) -> ProviderIdentity:
    return ProviderIdentity("https://uni.example", subject, {"name": subject, "groups": list(groups)}, False)


def sign_in(services: Services, subject: str, *groups: str) -> provider_sign_in.SignInOutcome:
    attempt = LoginAttempt(provider="uni", purpose="sign in", next_page="/", expires_at=now())
    return provider_sign_in.finish_sign_in(
        services.database, services.settings, "uni", attempt, recognised(subject, *groups), "a browser"
    )


def identity(services: Services, name: str) -> Identity:
    with services.database.read() as session:
        account = accounts.account_named(session, name)
        assert account is not None
        return signing_in.identity_of(account)


def with_second_factor(services: Services, name: str) -> tuple[str, list[str]]:
    """Give an account a second factor; the authenticator's next code, and the recovery codes."""
    me = identity(services, name)
    totp = pyotp.TOTP(account_service.start_second_factor(services.database, services.settings, me))
    recovery = account_service.confirm_second_factor(services.database, services.settings, me, totp.now())
    return totp.at(int(time.time()) + 30), recovery


def asked_for_code(services: Services, name: str) -> str:
    """Sign in by the provider alone; the cookie of the sign-in that waits for a code."""
    cookie = sign_in(services, name, "vision-lab").asks_code
    assert cookie is not None
    return cookie


def owners(services: Services) -> list[str]:
    with services.database.read() as session:
        members = workspaces.members(session, workspaces.find_workspace(session, "vision"))
        return [member.account for member in members if member.role == "owner"]


def at_once(*jobs: Callable[[], object]) -> tuple[list[threading.Thread], list[str]]:
    """Begin them all; their threads, and what becomes of them: "done", or the refusal's code."""
    ends: list[str] = []

    def run(job: Callable[[], object]) -> None:
        try:
            job()
        except ApiError as refusal:
            ends.append(refusal.code)
        except Exception as error:
            ends.append(repr(error))
        else:
            ends.append("done")

    threads = [threading.Thread(target=run, args=(job,)) for job in jobs]
    for thread in threads:
        thread.start()
    return threads, ends


def wait_for_locks(services: Services, number: int, threads: list[threading.Thread]) -> None:
    """Until so many statements wait for a lock, or nobody is left who could."""
    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends and any(thread.is_alive() for thread in threads):
        with services.database.engine.connect() as connection:
            if (connection.scalar(WAITING) or 0) >= number:
                return
        time.sleep(0.02)


def joined(threads: list[threading.Thread]) -> None:
    for thread in threads:
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


def reset_by_command_line(services: Services) -> None:
    with services.database.write() as session:
        account_service.reset_second_factor(session, "ada")


def removed_by_herself(services: Services) -> None:
    account_service.remove_second_factor(services.database, services.settings, identity(services, "ada"))


@pytest.mark.parametrize("taken_off", [reset_by_command_line, removed_by_herself])
def test_a_waiting_sign_in_ends_with_the_second_factor(
    services: Services, taken_off: Callable[[Services], None]
) -> None:
    sign_in(services, "ada", "vision-lab")
    with_second_factor(services, "ada")
    cookie = asked_for_code(services, "ada")
    taken_off(services)
    with pytest.raises(NotRecognised):
        provider_sign_in.finish_with_code(
            services.database, services.settings, services.sign_ins, cookie, "000000", "a browser"
        )
    with services.database.read() as session:
        assert session.query(LoginAttempt).count() == 0


def test_without_a_second_factor_no_code_signs_in(services: Services) -> None:
    """Where the sign-in was put down while the factor was being removed, say."""
    sign_in(services, "ada", "vision-lab")
    with_second_factor(services, "ada")
    cookie = asked_for_code(services, "ada")
    with services.database.write() as session:
        account = accounts.account_named(session, "ada")
        assert account is not None
        account.totp_secret = account.totp_confirmed_at = None
    with pytest.raises(NotRecognised):
        provider_sign_in.finish_with_code(
            services.database, services.settings, services.sign_ins, cookie, "000000", "a browser"
        )


def test_what_nobody_began_takes_no_turn_to_write(
    services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(services.database, "write", None)
    with pytest.raises(NotRecognised):
        provider_sign_in.take_attempt(services.database, "uni", "a state", "a cookie")


@pytest.mark.postgres
@on_postgres
@pytest.mark.parametrize("kind", ["authenticator", "recovery"])
def test_one_code_lets_one_of_two_in(services: Services, kind: str) -> None:
    sign_in(services, "ada", "vision-lab")
    next_code, recovery = with_second_factor(services, "ada")
    code = next_code if kind == "authenticator" else recovery[0]
    cookies = [asked_for_code(services, "ada"), asked_for_code(services, "ada")]
    with services.database.write() as session:
        accounts.account_named(session, "ada", lock=True)
        threads, ends = at_once(
            *(
                lambda one=one: provider_sign_in.finish_with_code(
                    services.database, services.settings, services.sign_ins, one, code, "x"
                )
                for one in cookies
            )
        )
        wait_for_locks(services, 2, threads)
    joined(threads)
    assert sorted(ends) == ["done", "wrong_credentials"]


@pytest.mark.postgres
@on_postgres
def test_two_owners_who_go_at_once_leave_one(services: Services) -> None:
    for name in ("ada", "zoe"):
        sign_in(services, name, "vision-lab")
    with services.database.write() as session:
        vision = workspaces.find_workspace(session, "vision", lock=True)
        workspaces.set_member(session, vision, "zoe", None, OPERATOR)
        threads, ends = at_once(lambda: sign_in(services, "ada"))
        wait_for_locks(services, 1, threads)
    joined(threads)
    assert (ends, owners(services)) == (["done"], ["ada"])


@pytest.mark.postgres
@on_postgres
def test_newcomers_at_once_do_not_shut_each_other_out(services: Services) -> None:
    """Each new membership holds its workspace a little, so that holding it wholly later would cross."""
    with services.database.write() as session:
        workspaces.find_workspace(session, "vision", lock=True)
        threads, ends = at_once(
            lambda: sign_in(services, "ada", "vision-lab"), lambda: sign_in(services, "zoe", "vision-lab")
        )
        wait_for_locks(services, 2, threads)
    joined(threads)
    assert (ends, sorted(owners(services))) == (["done", "done"], ["ada", "zoe"])
