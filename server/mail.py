"""Mail by the SMTP server of the settings: short letters in plain text."""

import logging
import smtplib
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from email.errors import MessageError
from email.headerregistry import Address
from email.message import EmailMessage
from email.utils import formatdate, make_msgid

from server.settings import Settings

log = logging.getLogger("palpebra")
TIMEOUT_S = 20.0


def can_send(settings: Settings) -> bool:
    """True where a server for mail is set."""
    return bool(settings.smtp_host and settings.mail_from)


def send(settings: Settings, to: str, subject: str, text: str) -> bool:
    """Hand one letter to the SMTP server; False, with the reason in the log, where it did not take it.

    Neither the log nor the caller tells to whom.
    """
    try:
        letter = _letter(settings.mail_from, to, subject, text)
        with _connected(settings) as server:
            server.send_message(letter, to_addrs=[to])
    except (OSError, smtplib.SMTPException, ValueError, MessageError) as error:
        code = getattr(error, "smtp_code", "")
        log.error("a letter was not sent: %s %s", type(error).__name__, code)
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
def _connected(settings: Settings) -> Iterator[smtplib.SMTP]:
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
