"""After the secret key was changed: carry over what was kept under the old one."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from experiments.errors import InputError
from server.accounts import repository as accounts
from server.accounts.audit import SECOND_FACTOR_SET_UP, record
from server.accounts.identity import OPERATOR
from server.accounts.second_factor import rewrapped
from server.audit.repository import hold_chain
from server.audit.resealing import reseal, under
from server.audit.verify import verify
from server.identities.repository import rewrap_all


@dataclass(frozen=True)
class CarriedOver:
    """What is under the key of now.

    Attributes
    ----------
    identities, unreadable : int
        Recruiters' ids whose keys were wrapped anew, and those that are not under the old key.
    second_factors : int
        Of accounts.
    broken : str or None
        Why the audit log and second factors were left as they are; None where all was carried over.
    """

    identities: int
    unreadable: int
    second_factors: int
    broken: str | None


def carry_over(session: Session, old: bytes, secret: bytes) -> CarriedOver:
    """Wrap recruiters' ids and second factors under the key of now, and make the audit log's chain by it.

    A log that fits neither key is left as it is: it must not become whole by this. So are second factors
    then, since only the log says under which key each was set up; recruiters' ids say it themselves.

    Raises
    ------
    InputError
        Nothing is under the old key: it never was this server's, or all was carried over before.
    """
    # Accounts before the chain, as a sign-in holds them: in the other order the two wait for one another.
    accounts.with_second_factor(session)
    hold_chain(session)
    before = verify(session, secret, before=old)
    done, left = rewrap_all(session, old)
    if not done and not any(under(session, old)):
        raise InputError(
            "nothing on this server is under that key: it was never the key here, or all was carried over "
            "before"
        )
    if before.broken is not None:
        return CarriedOver(done, left, 0, before.broken)
    factors = _carry_factors(session, old, secret)
    reseal(session, secret)
    head = f"{before.position}:{before.hash}"
    record(session, OPERATOR, "secret key changed", "", "", head_before=head)
    return CarriedOver(done, left, factors, None)


def _carry_factors(session: Session, old: bytes, secret: bytes) -> int:
    """Of a log that fits; who set one up since the key was changed did so under the key of now."""
    of_now = {entry.account_id for entry in under(session, secret) if entry.action == SECOND_FACTOR_SET_UP}
    # Read anew: looking through the log lets go of what was read before.
    holders = [holder for holder in accounts.with_second_factor(session) if holder.id not in of_now]
    for holder in holders:
        holder.totp_secret = rewrapped(old, secret, holder.totp_secret or "")
    return len(holders)
