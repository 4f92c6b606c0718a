"""After the secret key was changed: carry over what was kept under the old one."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from experiments.errors import InputError
from server.accounts import repository as accounts
from server.accounts.audit import record
from server.accounts.identity import OPERATOR
from server.accounts.second_factor import rewrapped
from server.audit.repository import hold_chain
from server.audit.resealing import first_under, reseal
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
        Why the audit log was left as it is; None where its chain was made anew.
    """

    identities: int
    unreadable: int
    second_factors: int
    broken: str | None


def carry_over(session: Session, old: bytes, secret: bytes) -> CarriedOver:
    """Wrap recruiters' ids and second factors under the key of now, and make the audit log's chain by it.

    A log that fits neither key is left as it is: it must not become whole by this.

    Raises
    ------
    InputError
        Nothing is under the old key: it never was this server's, or all was carried over before.
    """
    hold_chain(session)
    done, left = rewrap_all(session, old)
    if not done and first_under(session, old) is None:
        raise InputError(
            "nothing on this server is under that key: it was never the key here, or all was carried over "
            "before"
        )
    # Who set one up since the key was changed did so under the key of now.
    holders = accounts.with_second_factor(session, before=first_under(session, secret))
    for holder in holders:
        holder.totp_secret = rewrapped(old, secret, holder.totp_secret or "")
    before = verify(session, secret, before=old)
    if before.broken is None:
        reseal(session, secret)
        head = f"{before.position}:{before.hash}"
        record(session, OPERATOR, "secret key changed", "", "", head_before=head)
    return CarriedOver(done, left, len(holders), before.broken)
