"""Letters about one's own account: whatever opens it has changed, and if it was not she, what to do."""

from dataclasses import dataclass

from server import mail
from server.accounts import repository
from server.context import Services


@dataclass(frozen=True)
class Notice:
    """What happened to an account, as its letter says it.

    Attributes
    ----------
    subject : str
        Head of the letter.
    sentence : str
        What happened; `{name}` stands for the account's name.
    """

    subject: str
    sentence: str


PASSWORD_CHANGED = Notice(
    "Your password for Palpebra was changed",
    "The password of the account '{name}' was changed under My account; every other browser is signed out.",
)
PASSWORD_RESET = Notice(
    "Your password for Palpebra was reset",
    "The password of the account '{name}' was reset by whoever runs the server.",
)
SECOND_FACTOR_ADDED = Notice(
    "A second factor was added to your Palpebra account",
    "The account '{name}' is now signed in to with a code of an authenticator app.",
)
SECOND_FACTOR_REMOVED = Notice(
    "The second factor of your Palpebra account was removed",
    "The account '{name}' is signed in to without a code from now on.",
)
RECOVERY_CODE_USED = Notice(
    "A recovery code of your Palpebra account was used",
    "Somebody signed in to the account '{name}' with a recovery code, not with the authenticator app.",
)
LOGIN_ADDED = Notice(
    "A login was added to your Palpebra account",
    "The account '{name}' can now be signed in to by another login of a provider; My account lists them.",
)
LOGIN_REMOVED = Notice(
    "A login was removed from your Palpebra account",
    "A login of a provider no longer opens the account '{name}'; My account lists those that do.",
)
NEW_BROWSER = Notice(
    "Your Palpebra account was signed in to from a new browser",
    "Somebody signed in to the account '{name}' in a browser that had not been signed in to it before.",
)


@dataclass(frozen=True)
class Told:
    """A notice, and the number of the account it is for."""

    account_id: int
    notice: Notice


def tell(services: Services, account_id: int, notice: Notice) -> None:
    """Send a notice to an account's confirmed address, if it has one and the server sends mail.

    Runs after the answer: whether a letter goes out shows in no answer and holds none up.
    """
    if not mail.can_send(services.settings):
        return
    with services.database.read() as session:
        account = repository.account(session, account_id)
        name, address = (account.name, account.email) if account else ("", None)
    if address is None:
        return
    text = (
        f"{notice.sentence.format(name=name)} This is the server {services.settings.public_url}.\n\n"
        "If it was you, there is nothing to do. If it was not, sign in, choose a new password under My "
        "account, which signs every other browser out, and tell an owner of the server.\n"
    )
    mail.send(services.settings, address, notice.subject, text)
