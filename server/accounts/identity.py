"""Whom a request or a command acts for, and the refusals of those who may not do what they ask."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Literal

from server.core.errors import ApiError
from server.core.values import now

Scope = Literal["read", "personal", "write", "export"]
FRESH_FOR = timedelta(minutes=15)
"""After signing in, what would outlive a stolen session may be changed for so long."""


class NotSignedIn(ApiError, status=401, code="not_signed_in"):
    """The request carries no valid session or token."""


class UnknownToken(NotSignedIn):
    """The session's cookie or the API token is nobody's."""

    audited = True


class NotAllowed(ApiError, status=403, code="not_allowed", audited=True):
    """The account's role or the token's scope is not enough."""


class SecondFactorNeeded(ApiError, status=403, code="second_factor_needed", audited=True):
    """This is only open to accounts that signed in with a second factor."""


class SignInAgain(ApiError, status=403, code="sign_in_again"):
    """This would outlive a stolen session, and this session began a while ago."""


@dataclass(frozen=True)
class Identity:
    """The account behind a request; `session_id` for a browser, `scopes` for a token.

    Attributes
    ----------
    role : str
        On the server; what may be done with a study is asked by `server.studies.lookup.find_study`.
    held_back : bool
        An owner who is no more than an experimenter until she signs in with a second factor.
    second_factor : bool
        The session began with one, or the token's account has one.
    signed_in_at : datetime or None
        When the browser's session began; None for a token.
    """

    account_id: int
    name: str
    role: str
    session_id: int | None = None
    scopes: frozenset[str] | None = None
    second_factor: bool = False
    signed_in_at: datetime | None = None
    held_back: bool = False

    @property
    def sees_persons(self) -> bool:
        """True for browsers, and for tokens with the scope `personal`."""
        return self.scopes is None or "personal" in self.scopes


class Operator:
    """The machine's operator: the command line and the server's own work. Every study is open to it."""

    account_id: Final = None
    name: Final = "command line"


OPERATOR: Final = Operator()


# Decision 0738: Lasting changes need a fresh sign-in.
def must_be_fresh(identity: Identity) -> None:
    """SignInAgain where the browser's session began longer ago than `FRESH_FOR`."""
    if identity.signed_in_at is None or now() - identity.signed_in_at > FRESH_FOR:
        minutes = FRESH_FOR // timedelta(minutes=1)
        raise SignInAgain(
            f"Please sign in again for this action: your last sign-in was more than {minutes} minutes ago."
        )
