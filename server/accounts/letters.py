"""Email by the SMTP server of the settings, and notices about your account."""

import logging
import smtplib
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from email.errors import MessageError
from email.headerregistry import Address
from email.message import EmailMessage
from email.utils import formatdate, make_msgid

from server.accounts import repository
from server.core.db import Database
from server.core.settings import Settings

# Mail by the SMTP server of the settings: short letters in plain text.

log = logging.getLogger("palpebra")
TIMEOUT_S = 20.0


def can_send(settings: Settings) -> bool:
    """True where a server for mail is set."""
    return bool(settings.smtp_host and settings.mail_from)


def send_mail(settings: Settings, to: str, subject: str, text: str) -> bool:
    """Send an email through the SMTP server; return False and log the reason if it is refused.

    The recipient appears neither in the log nor in the return value.
    """
    try:
        letter = _letter(settings.mail_from, to, subject, text)
        with _mail_connection(settings) as server:
            server.send_message(letter, to_addrs=[to])
    except (OSError, smtplib.SMTPException, ValueError, MessageError) as error:
        code = getattr(error, "smtp_code", "")
        log.error("an email was not sent: %s %s", type(error).__name__, code)
        return False
    return True


def _letter(sender: str, to: str, subject: str, text: str) -> EmailMessage:
    letter = EmailMessage()
    letter["From"], letter["Subject"] = sender, subject
    letter["To"] = Address(addr_spec=to)
    letter["Date"], letter["Message-ID"] = formatdate(), make_msgid(domain=_domain(sender))
    letter["Auto-Submitted"] = "auto-generated"
    letter.set_content(text)
    return letter


@contextmanager
def _mail_connection(settings: Settings) -> Iterator[smtplib.SMTP]:
    context, where = ssl.create_default_context(), (settings.smtp_host, settings.smtp_port)
    if settings.smtp_security == "tls":
        server: smtplib.SMTP = smtplib.SMTP_SSL(*where, timeout=TIMEOUT_S, context=context)
    else:
        server = smtplib.SMTP(*where, timeout=TIMEOUT_S)
    with server:
        if settings.smtp_security == "starttls":
            server.starttls(context=context)
        if settings.smtp_user and settings.smtp_password_file is not None:
            secret = settings.smtp_password_file.read_text(encoding="utf-8").strip()
            server.login(settings.smtp_user, secret)
        yield server


def _domain(address: str) -> str:
    return address.rpartition("@")[2].strip("> ") or "localhost"


# Letters about one's own account: whatever opens it has changed, and if it was not she, what to do.


@dataclass(frozen=True)
class Notice:
    """An event in an account, as described in its email.

    Attributes
    ----------
    subject : str
        Subject of the email.
    sentence : str
        What happened; `{name}` stands for the account's name.
    """

    subject: str
    sentence: str


PASSWORD_CHANGED = Notice(
    "Your password for Palpebra was changed",
    "The password of the account '{name}' was changed under My account. All other browsers were signed out.",
)
PASSWORD_RESET = Notice(
    "Your password for Palpebra was reset",
    "The password of the account '{name}' was reset by an administrator of the server.",
)
SECOND_FACTOR_ADDED = Notice(
    "A second factor was added to your Palpebra account",
    "Signing in to the account '{name}' now requires a code from an authenticator app.",
)
SECOND_FACTOR_REMOVED = Notice(
    "The second factor of your Palpebra account was removed",
    "Signing in to the account '{name}' no longer requires a code.",
)
RECOVERY_CODE_USED = Notice(
    "A recovery code of your Palpebra account was used",
    "Someone signed in to the account '{name}' with a recovery code instead of the authenticator app.",
)
LOGIN_ADDED = Notice(
    "A login was added to your Palpebra account",
    "The account '{name}' can now be accessed with an additional provider login. My account lists all "
    "logins.",
)
LOGIN_REMOVED = Notice(
    "A login was removed from your Palpebra account",
    "A provider login was removed from the account '{name}'. My account lists the remaining logins.",
)
NEW_BROWSER = Notice(
    "New browser signed in to your Palpebra account",
    "Someone signed in to the account '{name}' with a new browser.",
)


@dataclass(frozen=True)
class NoticeRecipient:
    """A notice, and the number of the account it is for."""

    account_id: int
    notice: Notice


def send_notice(database: Database, settings: Settings, account_id: int, notice: Notice) -> None:
    """Send a notice to an account's confirmed address, if it has one and the server sends mail.

    Runs after the answer: whether a letter goes out shows in no answer and holds none up.
    """
    if not can_send(settings):
        return
    with database.read() as session:
        account = repository.account(session, account_id)
        name, address = (account.name, account.email) if account else ("", None)
    if address is None:
        return
    text = (
        f"{notice.sentence.format(name=name)} The server is {settings.public_url}.\n\n"
        "If this was you, you do not need to do anything. If not, sign in and choose a new password under "
        "My account. This signs out all other browsers. Then inform an owner of the server.\n"
    )
    send_mail(settings, address, notice.subject, text)
