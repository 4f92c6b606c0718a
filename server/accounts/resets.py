"""The rules of reset by mail: who gets a link, how often, and what a new password ends."""

from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy.orm import Session

from server.accounts import letters, repository
from server.accounts import repository as accounts
from server.accounts.access import account_of
from server.accounts.audit import NOBODY, record
from server.accounts.identity import Identity, NotSignedIn
from server.accounts.service import renew
from server.accounts.signing_in import identity_of
from server.accounts.throttle import SignInThrottle, known_device
from server.core.db import Database
from server.core.errors import Conflict
from server.core.settings import Settings
from server.core.values import hash_token, new_token, now
from server.models import Account, LetterPurpose, MailedLink

LINK_MINUTES = 30
MAX_OPEN_LINKS = 3
"""Per account and purpose at a time: someone who knows a name cannot fill an inbox."""
MAX_RESET_LETTERS_A_DAY = 10
"""Per account, until one of them is used."""
RESERVED_LETTERS, RESERVED_LINKS = 4, 1
"""Of these and of the open links, the part reserved for browsers in which the account signed in before:
somebody who knows a name and has many addresses uses up all the others."""


class LinkOver(Conflict, code="link_over"):
    """The link was used, is too old, or was never made."""


@dataclass(frozen=True)
class LetterRequest:
    """Who asks for a letter.

    Attributes
    ----------
    address : str
        Where from; counted by its range, and not kept.
    device : str or None
        The cookie of a browser that signed in before.
    """

    address: str
    device: str | None


@dataclass(frozen=True)
class Letter:
    """A letter to be sent once the link in it is stored."""

    to: str
    subject: str
    text: str


def post(settings: Settings, letter: Letter | None) -> None:
    """Send a letter, if there is one."""
    if letter is not None:
        letters.send_mail(settings, letter.to, letter.subject, letter.text)


def write_to_who_forgot(
    database: Database, settings: Settings, sign_ins: SignInThrottle, name: str, asking: LetterRequest
) -> None:
    """Send links for a new password to the accounts of this name or address; nothing where there are none.

    Runs after the answer, which so says nothing of whether there are any, by its words or its time.
    """
    letters = []
    with database.write() as session:
        repository.forget_old(session)
        for account in repository.accounts_to_write_to(session, name):
            if account.email is None or not _may_have_one(settings, sign_ins, session, account, asking):
                continue
            token = _store_link(session, account, "new password", account.email)
            record(session, NOBODY, "password reset asked for", "account", account.name)
            letters.append(_reset_letter(settings.public_url, account, token))
    for letter in letters:
        post(settings, letter)


def _may_have_one(
    settings: Settings, sign_ins: SignInThrottle, session: Session, account: Account, asking: LetterRequest
) -> bool:
    """Whether one more letter goes out: a share is kept for browsers of the account's own."""
    own = known_device(settings.key, account.name, asking.device) is not None
    links = MAX_OPEN_LINKS + (RESERVED_LINKS if own else 0)
    letters = MAX_RESET_LETTERS_A_DAY - (0 if own else RESERVED_LETTERS)
    return (
        repository.open_links(session, account.id, "new password") < links
        and repository.links_of_a_day(session, account.id, "new password") < letters
        and (own or sign_ins.may_have_letter(account.id, asking.address))
    )


def _store_link(session: Session, account: Account, purpose: LetterPurpose, address: str) -> str:
    token = new_token()
    session.add(
        MailedLink(
            token_hash=hash_token(token),
            account_id=account.id,
            purpose=purpose,
            address=address,
            expires_at=now() + timedelta(minutes=LINK_MINUTES),
        )
    )
    session.flush()
    return token


def name_of(database: Database, token: str) -> str:
    """Whose password a link is for; LinkOver where it does not work."""
    with database.read() as session:
        return _link(session, token, "new password").account.name


def set_password(database: Database, token: str, fresh: str) -> Letter | None:
    """Give the account of a link a new password (its hash); its sessions, API tokens and logins end.

    Returns
    -------
    Letter or None
        That it happened, to the account's address.
    """
    with database.write() as session:
        account = _use_link(session, token, "new password")
        logins = renew(session, identity_of(account), account, fresh)
        record(session, identity_of(account), "password reset by mail", "account", account.name)
        return _done_letter(account, logins)


def ask_to_confirm(database: Database, settings: Settings, me: Identity, address: str) -> Letter:
    """Keep a link by which an address of mail becomes one's own; the password was asked for."""
    with database.write() as session:
        repository.forget_old(session)
        account = account_of(session, me)
        accounts.hold(session, account.id)
        asking = accounts.session_of(session, account.id, me.session_id)
        if asking is None or asking.revoked_at is not None:
            raise NotSignedIn("Your session has ended; please sign in again.")
        if repository.open_links(session, account.id, "address") >= MAX_OPEN_LINKS:
            raise Conflict(f"Several emails have already been sent. Try again in {LINK_MINUTES} minutes.")
        token = _store_link(session, account, "address", address)
        return _confirm_letter(settings.public_url, account, address, token)


def confirm_address(database: Database, token: str) -> Letter | None:
    """Make the address that a link went to the account's own.

    Returns
    -------
    Letter or None
        That it happened, to the address that was the account's before; None where it had none or this one.
    """
    with database.write() as session:
        address = _link(session, token, "address").address
        account = _use_link(session, token, "address")
        repository.forget_links(session, account.id, "new password")
        before, account.email = account.email, address
        record(session, identity_of(account), "address of mail confirmed", "account", account.name)
        return _moved_letter(account, before)


def remove_address(database: Database, me: Identity) -> Letter | None:
    """Take the address of mail off one's own account; gives the letter that says so to that address."""
    with database.write() as session:
        account = account_of(session, me)
        before, account.email = account.email, None
        repository.forget_links(session, account.id, "new password")
        record(session, me, "address of mail removed", "account", account.name)
        return _moved_letter(account, before)


def _link(session: Session, token: str, purpose: LetterPurpose) -> MailedLink:
    link = repository.find_mailed_link(session, hash_token(token), purpose)
    if link is None or link.account.disabled_at is not None:
        raise LinkOver("This link was already used or has expired (30 minutes). Request a new one.")
    return link


def _use_link(session: Session, token: str, purpose: LetterPurpose) -> Account:
    link = _link(session, token, purpose)
    account = link.account
    if not repository.use_link(session, link.id):
        raise LinkOver("This link was already used or has expired (30 minutes). Request a new one.")
    return account


def _reset_letter(public_url: str, account: Account, token: str) -> Letter:
    text = (
        f"Someone, probably you, requested a new password for the account '{account.name}' on "
        f"{public_url}.\n\n"
        f"To choose a new password, open this link within {LINK_MINUTES} "
        f"minutes:\n\n{public_url}/admin/letter/password#{token}\n\n"
        "If this was not you, you do not need to do anything. Your password stays the same.\n"
    )
    return Letter(account.email or "", "A new password for Palpebra", text)


def _done_letter(account: Account, logins: str) -> Letter | None:
    text = (
        f"The password of the account '{account.name}' was changed with a link sent to this address. All "
        f"browsers were signed out, and all API tokens have ended. {logins}\n\n"
        "If this was not you, inform an owner of the server.\n"
    )
    return Letter(account.email, "Your password for Palpebra was changed", text) if account.email else None


def _moved_letter(account: Account, before: str | None) -> Letter | None:
    if before is None or before == account.email:
        return None
    text = (
        f"This is no longer the email address of the account '{account.name}'. Someone who was signed in, "
        f"probably you, {'removed it' if account.email is None else 'confirmed another one'}. "
        "Links for a new password are no longer sent here.\n\n"
        "If this was not you, inform an owner of the server immediately.\n"
    )
    return Letter(before, "Your email address for Palpebra was changed", text)


def _confirm_letter(public_url: str, account: Account, address: str, token: str) -> Letter:
    text = (
        f"This email address was entered for the account '{account.name}' on {public_url}.\n\n"
        f"To confirm it, open this link within {LINK_MINUTES} "
        f"minutes:\n\n{public_url}/admin/letter/address#{token}\n\n"
        "If this was not you, you do not need to do anything.\n"
    )
    return Letter(address, "Confirm your email address for Palpebra", text)
