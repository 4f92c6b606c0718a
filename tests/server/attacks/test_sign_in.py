"""Sign-in under attack: no lock-out of others, no telling who exists, one use of what is for one use."""

import asyncio
import statistics
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pyotp
import pytest
from fastapi.testclient import TestClient

from server.accounts import credentials, invitations, signing_in
from server.accounts.credentials import (
    PasswordCheck,
    PasswordsBusy,
    PasswordWork,
    WeakPassword,
    check_strength,
    hash_password,
)
from server.accounts.throttle import BackOff, TooManyFailures, address_range, known_device, new_device
from server.context import Services
from server.core.settings import Settings
from server.models import Account, AdminSession
from tests.helpers.admins import PASSWORD, Admin, fresh_browser
from tests.helpers.databases import run_server_command
from tests.helpers.studies import FROM_OWN_PAGE
from tests.helpers.waiting import run_in_own_loop

SIX = 6
OTHER = "another quite long one"


def together(number: int, work) -> list[object]:
    """What each of `number` threads gets that set off at one moment."""
    start = threading.Barrier(number)

    def one(place: int) -> object:
        start.wait()
        try:
            return work(place)
        except Exception as refusal:
            return refusal

    with ThreadPoolExecutor(number) as pool:
        return list(pool.map(one, range(number)))


def test_of_six_who_use_one_invitation_one_gets_in(services: Services) -> None:
    _, token = invitations.invite(services.database, "owner", "", None)
    ready = hash_password(PASSWORD, "x")
    made = together(
        SIX,
        lambda n: invitations.accept_invitation(
            services.database, services.settings, token, f"owner{n}", ready, ""
        ),
    )
    assert sum(isinstance(one, str) for one in made) == 1, made
    with services.database.read() as session:
        assert session.query(Account).count() == 1


def test_of_six_who_use_one_recovery_code_or_one_time_code_one_gets_in(
    services: Services, owner: Admin
) -> None:
    setup = owner.send("POST", "/second-factor").json()
    totp = pyotp.TOTP(setup["secret"])
    codes = owner.send("PUT", "/second-factor", {"code": totp.now()}).json()["codes"]
    stored = signing_in.stored_password(services.database, owner.name)
    with services.database.write() as session:
        session.query(Account).update({"totp_last_step": None})
    for code in (codes[0], totp.now()):
        got = together(
            SIX,
            lambda _, code=code: signing_in.open_session(
                services.database,
                services.settings,
                services.sign_ins,
                owner.name,
                PasswordCheck(stored),
                code,
                "",
            ),
        )
        assert sum(token is not None for token, _ in got) == 1, got
    with services.database.read() as session:
        assert len(session.query(Account).one().recovery_code_hashes) == len(codes) - 1
        assert session.query(AdminSession).count() == 3


def sign_in(browser: TestClient, name: str, password: str, **headers: str) -> int:
    answer = browser.post("/api/admin/session", json={"name": name, "password": password}, headers=headers)
    return int(answer.status_code)


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_wrong_passwords_keep_nobody_else_out(client: TestClient, settings: Settings, owner: Admin) -> None:
    elsewhere = TestClient(
        client.app, base_url=settings.public_url, client=("203.0.113.9", 1), raise_server_exceptions=False
    )
    answers = [sign_in(elsewhere, owner.name, "wrong guess") for _ in range(8)]
    assert answers[:5] == [401] * 5
    assert 429 in answers
    assert sign_in(fresh_browser(client, settings), owner.name, PASSWORD) == 200  # from her own place
    owner.client.post("/api/admin/session", json={"name": owner.name, "password": "a slip"})
    known = TestClient(
        client.app, base_url=settings.public_url, client=("203.0.113.9", 1), headers=FROM_OWN_PAGE
    )
    known.cookies = owner.client.cookies  # her own browser, in the attacker's network
    assert sign_in(known, owner.name, PASSWORD) == 200


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_unknown_names_wait_and_are_told_alike(
    client: TestClient, services: Services, settings: Settings, owner: Admin
) -> None:
    services.sign_ins.per_range.per_minute = services.sign_ins.overall.per_minute = 10_000
    browser, told, spent = fresh_browser(client, settings), {}, {}
    for name in (owner.name, "nobody at all"):
        answers, times = [], []
        for _ in range(8):
            began = time.process_time()
            answer = browser.post("/api/admin/session", json={"name": name, "password": "wrong"})
            times.append(time.process_time() - began)  # of this process alone, however busy the machine
            answers.append((answer.status_code, answer.json()["error"]["code"]))
        told[name], spent[name] = answers, statistics.median(times[:5])
    assert told[owner.name] == told["nobody at all"]
    assert told[owner.name][-1] == (429, "too_many_failures")
    assert 0.3 < spent[owner.name] / spent["nobody at all"] < 3
    failed = [row for row in owner.get("/audit").json() if row["action"] == "sign-in failed"]
    assert {row["target"] for row in failed} == {owner.name, "(unknown)"}


def test_waiting_times_double_and_end() -> None:
    clock = [0.0]
    back_off = BackOff(clock=lambda: clock[0])
    waits = []
    for _ in range(20):
        try:
            back_off.check("a")
        except TooManyFailures as refusal:
            wait = int((refusal.headers or {})["retry-after"])
            waits.append(wait)
            clock[0] += wait
        back_off.failed("a")
    assert waits[:4] == [1, 2, 4, 8]
    assert max(waits) == 900
    back_off.check("b")


def test_ranges_of_addresses() -> None:
    assert address_range("203.0.113.77") == address_range("::ffff:203.0.113.1") == "203.0.113.0/24"
    assert address_range("2001:db8:1:2:3::4") == "2001:db8:1:2::/64"
    assert address_range("testclient") == "testclient"


def test_device_cookies_are_for_one_name_and_cannot_be_made() -> None:
    cookie = new_device(b"key", "Ada")
    assert known_device(b"key", "ada", cookie)
    for name, key, given in (("eve", b"key", cookie), ("ada", b"other", cookie), ("ada", b"key", "x.y")):
        assert known_device(key, name, given) is None


@pytest.mark.parametrize(
    "password",
    [
        "1234567890",
        "123456789012",
        "the owner 1",
        "the owner the owner",
        "Password2024!",
        "qwertyuiop12",
        "aaaaaaaaaaaaaa",
    ],
)
def test_passwords_that_anybody_would_try_are_refused(password: str) -> None:
    with pytest.raises(WeakPassword):
        check_strength(password, "the owner")


@pytest.mark.parametrize("password", [PASSWORD, OTHER, "x7Gq!mzP02vbT", "später kommt der Kater"])
def test_good_passwords_are_taken(password: str) -> None:
    check_strength(password, "the owner")


def test_a_new_password_ends_tokens_too(client: TestClient, settings: Settings, owner: Admin) -> None:
    token = owner.send("POST", "/tokens", {"name": "t", "scopes": ["read"]}).json()["token"]
    script = {"authorization": f"Bearer {token}"}
    browser = fresh_browser(client, settings)
    assert browser.get("/api/admin/studies", headers=script).status_code == 200
    assert owner.send("PUT", "/password", {"password": PASSWORD, "new_password": OTHER}).status_code == 204
    assert browser.get("/api/admin/studies", headers=script).status_code == 401


def test_resets_by_command_line_are_audited(
    client: TestClient, settings: Settings, owner: Admin, tmp_path: Path
) -> None:
    setup = owner.send("POST", "/second-factor").json()
    owner.send("PUT", "/second-factor", {"code": pyotp.TOTP(setup["secret"]).now()})
    weak = run_server_command(settings, "account", "reset-password", owner.name, "--password", "1234567890")
    assert weak.returncode == 2
    for arguments in (
        ("reset-password", owner.name, "--password", OTHER),
        ("reset-second-factor", owner.name),
    ):
        called = run_server_command(settings, "account", *arguments)
        assert called.returncode == 0, called.stderr
    assert owner.get("/studies").status_code == 401
    assert sign_in(owner.client, owner.name, OTHER) == 200
    actions = {row["action"] for row in owner.get("/audit").json()}
    assert {"password reset", "second factor reset"} <= actions
    for command in ("reset-second-factor", "reset-password"):  # which asks for no password first
        unknown = run_server_command(settings, "account", command, "the owne")
        assert unknown.returncode == 2
        assert unknown.stdout == ""
        assert len(unknown.stderr.splitlines()) == 1


def test_a_hash_costs_what_is_recommended() -> None:
    assert hash_password("four walruses sang in March", "Ada").startswith("$argon2id$v=19$m=65536,t=3,p=4$")


def test_one_hash_at_a_time_and_of_those_who_wait_only_so_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes 64 MB and four cores; a thread more for each stranger is how the memory was filled."""
    monkeypatch.setattr(credentials, "_step_back", lambda: None)  # threads begin without their first hash
    at_once, highest, gate = 0, 0, threading.Event()

    def work() -> None:
        nonlocal at_once, highest
        at_once += 1
        highest = max(highest, at_once)
        gate.wait(30)
        at_once -= 1

    async def flood() -> list[object]:
        pool = PasswordWork(waiting=3)
        asked = [asyncio.create_task(pool.run(work)) for _ in range(10)]
        await asyncio.sleep(0.5)
        gate.set()
        answers = await asyncio.gather(*asked, return_exceptions=True)
        pool.close()
        return list(answers)

    answers = run_in_own_loop(flood())
    refused = [answer for answer in answers if isinstance(answer, PasswordsBusy)]
    assert (len(refused), answers.count(None), highest) == (7, 3, 1)
    assert refused[0].status == 503
