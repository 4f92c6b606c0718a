"""Reset by mail over a real SMTP server: what a letter opens, and what nobody learns."""

import datetime
import ssl
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from typing import Any

import hypothesis
import pyotp
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from fastapi.testclient import TestClient
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from server.accounts import letters, repository, resets
from server.accounts import service as accounts
from server.accounts.credentials import hash_password
from server.accounts.identity import Identity, NotSignedIn
from server.accounts.resets import (
    LINK_MINUTES,
    MAX_OPEN_LINKS,
    MAX_RESET_LETTERS_A_DAY,
    RESERVED_LETTERS,
    LetterRequest,
)
from server.accounts.schemas import Address
from server.accounts.service import end_everything
from server.accounts.throttle import DEVICE_COOKIE, LETTERS_FROM_A_RANGE
from server.app import create_app
from server.context import Services
from server.core.settings import Settings
from server.core.values import now
from server.models import Account, AdminSession, AuditEntry, MailedLink
from tests.helpers.admins import PASSWORD, Admin, signed_in
from tests.helpers.mail import ADDRESS, Letterbox, smtp_server

FRESH = "an entirely new passphrase"


def forget(browser: TestClient, name: str) -> Any:
    return browser.post("/api/admin/session/forgotten", json={"name": name})


def renew(browser: TestClient, token: str, password: str = FRESH) -> Any:
    return browser.post("/api/admin/session/new-password", json={"token": token, "password": password})


def sign_in(browser: TestClient, password: str, **more: str) -> int:
    body = {"name": "ada", "password": password, **more}
    return browser.post("/api/admin/session", json=body).status_code


@pytest.mark.parametrize("told", ["ada", "Ada", ADDRESS, ADDRESS.upper()])
def test_a_letter_opens_a_new_password_once(
    ada: Admin, stranger: TestClient, box: Letterbox, told: str
) -> None:
    assert forget(stranger, told).status_code == 202
    [letter] = box.letters
    assert letter["To"] == ADDRESS
    token = box.token()
    assert renew(stranger, token).status_code == 204
    assert renew(stranger, token, "yet another long passphrase").json()["error"]["code"] == "link_over"
    assert (sign_in(stranger, PASSWORD), sign_in(stranger, FRESH)) == (401, 200)
    assert "was changed" in box.letters[1]["Subject"]


def test_sessions_and_tokens_end_with_it(
    ada: Admin, stranger: TestClient, box: Letterbox, services: Services
) -> None:
    secret = ada.send("POST", "/tokens", {"name": "script", "scopes": ["read"]}).json()["token"]
    forget(stranger, "ada")
    renew(stranger, box.token())
    assert ada.get("/studies").status_code == 401
    headers = {"authorization": f"Bearer {secret}"}
    assert stranger.get("/api/admin/studies", headers=headers).status_code == 401
    with services.database.read() as session:
        actions = [row.action for row in session.query(AuditEntry).order_by(AuditEntry.id)]
    assert actions[-2:] == ["password reset asked for", "password reset by mail"]


def test_the_answer_says_nothing_of_who_is_there(
    ada: Admin, client: TestClient, stranger: TestClient, services: Services, box: Letterbox
) -> None:
    signed_in(client, services, "viewer", "without address")
    answers = [forget(stranger, name) for name in ("ada", "nobody", "without address", "x@y.example")]
    assert {(answer.status_code, answer.text) for answer in answers} == {(202, "null")}
    assert len(box.letters) == 1


def test_the_token_lies_nowhere(ada: Admin, stranger: TestClient, box: Letterbox, services: Services) -> None:
    forget(stranger, "ada")
    with services.database.read() as session:
        [row] = session.query(MailedLink)
        stored = " ".join(str(getattr(row, column.name)) for column in MailedLink.__table__.columns)
        audited = " ".join(f"{entry.target} {entry.details}" for entry in session.query(AuditEntry))
    assert box.token() not in stored + audited
    assert ADDRESS not in audited


def test_a_link_ends_after_half_an_hour(
    ada: Admin, stranger: TestClient, box: Letterbox, services: Services
) -> None:
    forget(stranger, "ada")
    with services.database.write() as session:
        [row] = session.query(MailedLink)
        assert row.expires_at <= now() + datetime.timedelta(minutes=LINK_MINUTES)
        row.expires_at = now()
    assert renew(stranger, box.token()).json()["error"]["code"] == "link_over"
    assert sign_in(stranger, PASSWORD) == 200


def test_a_box_is_not_filled(ada: Admin, stranger: TestClient, box: Letterbox) -> None:
    answers = {forget(stranger, "ada").status_code for _ in range(MAX_OPEN_LINKS + 2)}
    assert answers == {202}
    assert len(box.letters) == MAX_OPEN_LINKS


def test_a_place_that_asks_too_often_waits(stranger: TestClient, settings: Settings, box: Letterbox) -> None:
    # The share refills meanwhile, so that a slow machine is refused a little later.
    asked = (
        forget(stranger, f"name {number}").status_code for number in range(3 * settings.logins_per_minute)
    )
    answers = list(takewhile(lambda status: status == 202, asked))
    assert settings.logins_per_minute <= len(answers) < 3 * settings.logins_per_minute


def test_one_new_password_ends_the_other_links(ada: Admin, stranger: TestClient, box: Letterbox) -> None:
    forget(stranger, "ada")
    first = box.token()
    forget(stranger, "ada")
    assert renew(stranger, box.token()).status_code == 204
    assert renew(stranger, first).json()["error"]["code"] == "link_over"


def test_a_weak_password_uses_no_link_up(ada: Admin, stranger: TestClient, box: Letterbox) -> None:
    forget(stranger, "ada")
    assert renew(stranger, box.token(), "short").json()["error"]["code"] == "weak_password"
    assert renew(stranger, box.token()).status_code == 204


def test_the_second_factor_is_asked_for_still(ada: Admin, stranger: TestClient, box: Letterbox) -> None:
    secret = ada.send("POST", "/second-factor").json()["secret"]
    recovery = ada.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()}).json()["codes"]
    forget(stranger, "ada")
    renew(stranger, box.token())
    assert (sign_in(stranger, FRESH), sign_in(stranger, FRESH, code=recovery[0])) == (401, 200)


def test_a_closed_account_gets_no_letter_and_its_links_no_password(
    ada: Admin, stranger: TestClient, box: Letterbox, services: Services
) -> None:
    forget(stranger, "ada")
    with services.database.write() as session:
        session.query(Account).one().disabled_at = now()
    assert renew(stranger, box.token()).json()["error"]["code"] == "link_over"
    forget(stranger, "ada")
    assert len(box.letters) == 1


def test_an_address_is_confirmed_before_it_counts(ada: Admin, stranger: TestClient, box: Letterbox) -> None:
    body = {"address": "eve@evil.example", "password": PASSWORD}
    assert ada.send("PUT", "/mail", body | {"password": "wrong"}).status_code == 401
    assert ada.send("PUT", "/mail", body).status_code == 202
    assert renew(stranger, box.token()).json()["error"]["code"] == "link_over"
    forget(stranger, "ada")
    assert box.letters[-1]["To"] == ADDRESS
    token = box.token()
    assert ada.send("DELETE", "/mail").status_code == 422
    assert ada.send("DELETE", "/mail", {"password": "wrong"}).status_code == 401
    assert ada.get("/mail").json()["address"] == ADDRESS
    assert ada.send("DELETE", "/mail", {"password": PASSWORD}).status_code == 204
    assert renew(stranger, token).json()["error"]["code"] == "link_over"


@pytest.mark.parametrize(
    "address",
    [
        "no address",
        "a@b.example\nBcc: x@y.example",
        "a@b.example, c@d.example",
        "(eve)a@b.example",
        '"a b"@c.example',
        "a:b@c.example",
        "a..b@c.example",
        ".a@c.example",
        "a@c..example",
        "a@[127.0.0.1]",
        "a@-c.example",
        "\u00f6@c.example",
        "=?utf-8?q?eve?=@c.example",
        "a" * 65 + "@c.example",
    ],
)
def test_what_is_not_a_single_address_is_refused(ada: Admin, address: str) -> None:
    assert ada.send("PUT", "/mail", {"address": address, "password": PASSWORD}).status_code == 422


_LABELS = st.from_regex(r"[a-zA-Z0-9]([a-zA-Z0-9-]{0,20}[a-zA-Z0-9])?", fullmatch=True)
_ATOMS = st.from_regex(r"[A-Za-z0-9!#$%&'*+/=?^_`{|}~-]{1,20}", fullmatch=True)
_SIGNS = st.text(st.sampled_from("ab.@\"'()<>[]\\:;,=?-\u00f6 \r\n"), max_size=20)
_ADDRESSES = st.one_of(
    st.builds(
        lambda atoms, labels: f"{'.'.join(atoms)}@{'.'.join(labels)}",
        st.lists(_ATOMS, min_size=1, max_size=3),
        st.lists(_LABELS, min_size=2, max_size=3),
    ),
    st.builds(lambda before, after: f"{before}@{after}.example", _SIGNS, _SIGNS),
)


@hypothesis.given(address=_ADDRESSES)
@hypothesis.example(address="(eve)a@b.example")
@hypothesis.example(address="a:b@c.example")
@hypothesis.example(address="=?utf-8?q?eve?=@c.example")
@hypothesis.settings(
    max_examples=60, deadline=None, suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture]
)
def test_a_letter_goes_to_the_address_and_nowhere_else(
    settings: Settings, box: Letterbox, address: str
) -> None:
    """Whatever is taken for an address is the envelope's one recipient, and what the letter's head says."""
    try:
        taken = TypeAdapter(Address).validate_python(address)
    except ValidationError:
        return
    box.letters.clear()
    assert letters.send_mail(settings, taken, "subject", "text")
    [letter] = box.letters
    assert (letter["To"].addresses[0].addr_spec, len(letter["To"].addresses)) == (taken, 1)


def test_a_server_without_mail_says_so(services: Services) -> None:
    without = services.settings.model_copy(update={"smtp_host": ""})
    with TestClient(create_app(without), base_url=without.public_url) as client:
        assert not client.get("/api/admin/session/ways").json()["resets_by_mail"]
        assert forget(client, "the owner").status_code == 404


def _own_certificate(folder: Path) -> ssl.SSLContext:
    """A certificate that nobody vouches for."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "127.0.0.1")])
    day = datetime.timedelta(days=1)
    certificate = (
        x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
        .serial_number(1).not_valid_before(now() - day).not_valid_after(now() + day)
        .sign(key, hashes.SHA256())
    )  # fmt: skip
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    path = folder / "own.pem"
    path.write_bytes(private + certificate.public_bytes(serialization.Encoding.PEM))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(path)
    return context


@pytest.mark.parametrize("offers_tls", [True, False])
def test_no_letter_goes_to_a_server_that_nobody_vouches_for(
    tmp_path: Path, settings: Settings, offers_tls: bool, caplog: pytest.LogCaptureFixture
) -> None:
    options = {"tls_context": _own_certificate(tmp_path)} if offers_tls else {}
    with smtp_server(**options) as (letterbox, port):
        strict = settings.model_copy(update={"smtp_port": port, "smtp_security": "starttls"})
        assert not letters.send_mail(strict, ADDRESS, "subject", "text")
    assert letterbox.letters == []
    assert "an email was not sent" in caplog.text
    assert ADDRESS not in caplog.text


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"smtp_host": "mail.example"}, "PALPEBRA_MAIL_FROM is required"),
        ({"smtp_host": "mail.example", "mail_from": "a@b.example", "smtp_security": "none"}, "unencrypted"),
        ({"mail_from": "nobody"}, "expected one email address"),
    ],
)
def test_settings_that_would_lose_letters_are_refused(values: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        Settings(**values)


def _asks_for_eves_address(ada: Admin, box: Letterbox) -> str:
    asked = ada.send("PUT", "/mail", {"address": "eve@evil.example", "password": PASSWORD})
    assert asked.status_code == 202
    return box.token()


def _change(ada: Admin, services: Services, stranger: TestClient, box: Letterbox) -> None:
    body = {"password": PASSWORD, "new_password": FRESH}
    assert ada.send("PUT", "/password", body).status_code == 204


def _reset_by_mail(ada: Admin, services: Services, stranger: TestClient, box: Letterbox) -> None:
    forget(stranger, "ada")
    assert renew(stranger, box.token()).status_code == 204


def _reset_by_command(ada: Admin, services: Services, stranger: TestClient, box: Letterbox) -> None:
    with services.database.write() as session:
        accounts.reset_password(session, "ada", hash_password(FRESH, "ada"))


@pytest.mark.parametrize("renews", [_change, _reset_by_mail, _reset_by_command])
def test_a_new_password_ends_a_strangers_link_for_an_address(
    ada: Admin,
    stranger: TestClient,
    box: Letterbox,
    services: Services,
    renews: Callable[[Admin, Services, TestClient, Letterbox], None],
) -> None:
    """Asked for in a stolen session, it would make the stranger's address the account's afterwards."""
    pending = _asks_for_eves_address(ada, box)
    renews(ada, services, stranger, box)
    confirmed = stranger.post("/api/admin/session/mail", json={"token": pending})
    assert confirmed.json()["error"]["code"] == "link_over"
    with services.database.read() as session:
        assert session.query(Account).one().email == ADDRESS


def test_no_link_is_kept_for_a_session_that_has_just_ended(ada: Admin, services: Services) -> None:
    with services.database.write() as session:
        account = session.query(Account).one()
        asking = Identity(
            account.id, account.name, account.role, session_id=session.query(AdminSession).one().id
        )
        end_everything(session, account.id)
    with pytest.raises(NotSignedIn):
        resets.ask_to_confirm(services.database, services.settings, asking, "eve@evil.example")


def test_the_old_address_gets_a_notice_of_a_change(ada: Admin, stranger: TestClient, box: Letterbox) -> None:
    token = _asks_for_eves_address(ada, box)
    assert stranger.post("/api/admin/session/mail", json={"token": token}).status_code == 204
    assert (box.letters[-1]["To"], "confirmed another" in box.letters[-1].get_content()) == (ADDRESS, True)
    assert ada.send("DELETE", "/mail", {"password": PASSWORD}).status_code == 204
    assert box.letters[-1]["To"] == "eve@evil.example"
    sent = len(box.letters)
    assert ada.send("DELETE", "/mail", {"password": PASSWORD}).status_code == 204
    assert len(box.letters) == sent


@pytest.mark.parametrize("told", ["Özil", "özil", "ÖZIL"])
def test_names_beyond_ascii_are_known_in_any_capitals(
    client: TestClient, services: Services, stranger: TestClient, box: Letterbox, told: str
) -> None:
    signed_in(client, services, "viewer", "Özil")
    with services.database.write() as session:
        session.query(Account).one().email = ADDRESS
    body = {"name": told, "password": PASSWORD}
    assert stranger.post("/api/admin/session", json=body).status_code == 200
    box.letters.clear()
    forget(stranger, told)
    assert [letter["To"] for letter in box.letters] == [ADDRESS]


def test_two_names_that_differ_in_capitals_alone_stay_two_accounts(
    client: TestClient, services: Services
) -> None:
    with services.database.write() as session:
        for name in ("Özil", "özil"):
            session.add(Account(name=name, password_hash="", role="viewer"))
    with services.database.read() as session:
        named = [repository.account_named(session, name) for name in ("Özil", "özil", "ÖZIL")]
    assert [account and account.name for account in named] == ["Özil", "özil", "Özil"]


def test_strangers_do_not_keep_an_owner_from_her_address(
    ada: Admin, stranger: TestClient, box: Letterbox
) -> None:
    for _ in range(MAX_OPEN_LINKS):
        forget(stranger, "ada")
    body = {"address": "ada@new.example", "password": PASSWORD}
    assert ada.send("PUT", "/mail", body).status_code == 202
    assert box.letters[-1]["To"] == "ada@new.example"


def _hours_pass(services: Services, hours: float) -> None:
    with services.database.write() as session:
        for row in session.query(MailedLink):
            row.created_at -= datetime.timedelta(hours=hours)
            row.expires_at -= datetime.timedelta(hours=hours)


def asking_from(number: int, device: str | None = None) -> LetterRequest:
    """Somebody at an address that shares its range with no other number's."""
    return LetterRequest(f"198.51.{number}.7", device)


def test_an_account_gets_so_many_letters_a_day(ada: Admin, services: Services, box: Letterbox) -> None:
    own = ada.client.cookies[DEVICE_COOKIE]
    for number in range(MAX_RESET_LETTERS_A_DAY + 2):
        resets.write_to_who_forgot(
            services.database, services.settings, services.sign_ins, "ada", asking_from(number, own)
        )
        _hours_pass(services, 1)
    assert len(box.letters) == MAX_RESET_LETTERS_A_DAY
    _hours_pass(services, 24)
    resets.write_to_who_forgot(services.database, services.settings, services.sign_ins, "ada", asking_from(1))
    assert len(box.letters) == MAX_RESET_LETTERS_A_DAY + 1


def test_strangers_do_not_use_up_the_letters_of_a_day(
    ada: Admin, services: Services, box: Letterbox, stranger: TestClient
) -> None:
    for number in range(3 * MAX_RESET_LETTERS_A_DAY):
        resets.write_to_who_forgot(
            services.database, services.settings, services.sign_ins, "ada", asking_from(number, "made.up")
        )
        _hours_pass(services, 0.55)
    assert len(box.letters) == MAX_RESET_LETTERS_A_DAY - RESERVED_LETTERS
    ada.client.post(
        "/api/admin/session/forgotten", json={"name": ADDRESS}
    )  # by the address: the same browser
    assert len(box.letters) == MAX_RESET_LETTERS_A_DAY - RESERVED_LETTERS + 1
    assert renew(stranger, box.token()).status_code == 204


def test_a_range_of_addresses_gets_an_account_so_many_letters(
    ada: Admin, services: Services, box: Letterbox
) -> None:
    for last in range(2 * LETTERS_FROM_A_RANGE):
        resets.write_to_who_forgot(
            services.database,
            services.settings,
            services.sign_ins,
            "ada",
            LetterRequest(f"198.51.100.{last}", None),
        )
        _hours_pass(services, 1)
    assert len(box.letters) == LETTERS_FROM_A_RANGE
    resets.write_to_who_forgot(services.database, services.settings, services.sign_ins, "ada", asking_from(1))
    assert len(box.letters) == LETTERS_FROM_A_RANGE + 1


def test_open_links_of_strangers_leave_one_for_an_own_browser(
    ada: Admin, services: Services, box: Letterbox
) -> None:
    for number in range(MAX_OPEN_LINKS + 2):
        resets.write_to_who_forgot(
            services.database, services.settings, services.sign_ins, "ada", asking_from(number)
        )
    assert len(box.letters) == MAX_OPEN_LINKS
    resets.write_to_who_forgot(
        services.database,
        services.settings,
        services.sign_ins,
        "ada",
        asking_from(9, ada.client.cookies[DEVICE_COOKIE]),
    )
    assert len(box.letters) == MAX_OPEN_LINKS + 1
