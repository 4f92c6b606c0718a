"""Signing in by a university's or ORCID's own service: whom its subjects are here, and sign-ins under way."""

from datetime import datetime
from typing import Literal, get_args

from sqlalchemy import ForeignKey, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from server.clock import now
from server.models.accounts import Account
from server.models.base import Base, one_of

Purpose = Literal["sign in", "link", "code"]
PURPOSES: tuple[Purpose, ...] = get_args(Purpose)


class AccountLogin(Base):
    """A subject of an issuer, and the account that it signs in to; nothing else recognises anybody.

    Attributes
    ----------
    label : str
        How the person shows her logins apart: her name with the provider.
    """

    __tablename__ = "account_logins"
    __table_args__ = (UniqueConstraint("issuer", "subject"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    account_id: Mapped[int] = mapped_column(ForeignKey("accounts.id", ondelete="CASCADE"), index=True)
    provider: Mapped[str] = mapped_column(String(30))
    issuer: Mapped[str] = mapped_column(String(300))
    subject: Mapped[str] = mapped_column(String(255))
    label: Mapped[str] = mapped_column(String(100), default="")
    created_at: Mapped[datetime] = mapped_column(default=now)
    last_used_at: Mapped[datetime | None]

    account: Mapped[Account] = relationship()


class LoginAttempt(Base):
    """A sign-in that a browser began and the provider has not finished; removed when it is used.

    Attributes
    ----------
    state_hash, browser_hash : str
        Of the request's state and of the browser's cookie. Nonce and PKCE's verifier are derived from that
        cookie with the server's key, so that neither lies here.
    purpose : {"sign in", "link", "code"}
        `code`: the provider has recognised the account, whose second factor is asked for still.
    session_id : int or None
        The session that asked to link; it must be open still when the browser comes back.
    invitation_hash : str or None
        `Invitation.token_hash` of what the person was invited by, who is to be given an account. Not its
        number, which another invitation may get once it is taken back.
    """

    __tablename__ = "login_attempts"
    __table_args__ = (one_of("purpose", *PURPOSES),)

    id: Mapped[int] = mapped_column(primary_key=True)
    state_hash: Mapped[str] = mapped_column(String(64), unique=True)
    browser_hash: Mapped[str] = mapped_column(String(64))
    provider: Mapped[str] = mapped_column(String(30))
    purpose: Mapped[str] = mapped_column(String(10))
    next_page: Mapped[str] = mapped_column(String(300), default="/")
    account_id: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="CASCADE"), index=True)
    session_id: Mapped[int | None]
    invitation_hash: Mapped[str | None] = mapped_column(String(64))
    expires_at: Mapped[datetime] = mapped_column(index=True)
