"""One-time links that were sent by mail."""

from datetime import datetime
from typing import Literal, get_args

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column, relationship

from server.clock import now
from server.models.accounts import Account
from server.models.base import Base, one_of

LetterPurpose = Literal["new password", "address"]
LETTER_PURPOSES: tuple[LetterPurpose, ...] = get_args(LetterPurpose)


class MailedLink(Base):
    """A one-time link sent by mail, by its token's hash; it is removed when it is used, or after a day.

    Attributes
    ----------
    purpose : {"new password", "address"}
        What it is good for: a new password, or to confirm that the address is the account's.
    address : str
        Where it went.
    """

    __tablename__ = "mailed_links"
    __table_args__ = (one_of("purpose", *LETTER_PURPOSES),)

    id: Mapped[int] = mapped_column(primary_key=True)
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    account_id: Mapped[int] = mapped_column(ForeignKey("accounts.id", ondelete="CASCADE"), index=True)
    purpose: Mapped[str] = mapped_column(String(20))
    address: Mapped[str] = mapped_column(String(200))
    created_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime] = mapped_column(index=True)

    account: Mapped[Account] = relationship()
