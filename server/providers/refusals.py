"""How a sign-in by a provider is refused: one sentence for people, the reason in the log."""

import logging

from server.errors import ApiError

log = logging.getLogger("palpebra")


class ProviderAway(ApiError):
    """The provider does not answer, or not as one."""

    status = 503
    code = "provider_away"


class NotRecognised(ApiError):
    """What the provider's answer says does not hold."""

    status = 401
    code = "sign_in_refused"


class LogoutRefused(ApiError):
    """What came is no logout token that holds (Back-Channel Logout 1.0, 2.8)."""

    status = 400
    code = "logout_refused"


def away(why: str) -> ProviderAway:
    """A refusal to raise where the provider does not answer as it should."""
    log.warning("a provider of sign-in cannot be used: %s", why)
    return ProviderAway("The service to sign in with does not answer as it should; please try again later.")


def refused(why: str) -> NotRecognised:
    """A refusal to raise where what was answered does not hold."""
    log.warning("a sign-in by a provider is refused: %s", why)
    return NotRecognised("The sign-in could not be confirmed; please begin it again.")


def no_logout(why: str) -> LogoutRefused:
    """A refusal to raise where a logout token does not hold."""
    log.warning("a logout token of a provider is refused: %s", why)
    return LogoutRefused("This is no logout token that holds; the server's log says why.")
