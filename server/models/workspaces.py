"""Workspaces: the laboratories of one server, who belongs to them, and rights on single studies."""

from datetime import datetime
from typing import Literal, get_args

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from server.clock import now
from server.models.accounts import ROLES
from server.models.base import Base, one_of

Right = Literal["view", "run", "edit", "export", "own"]
RIGHTS: tuple[Right, ...] = get_args(Right)
"""What may be done with a study; see `server.workspaces.rights`."""
DEFAULT_WORKSPACE = "default"
"""Name of the workspace that holds whatever is put into no other."""


class Workspace(Base):
    """A laboratory: its people and its studies.

    Attributes
    ----------
    second_factor_required : bool
        Its studies open only to who signed in with a second factor.
    """

    __tablename__ = "workspaces"

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60), unique=True)
    title: Mapped[str] = mapped_column(String(200))
    second_factor_required: Mapped[bool] = mapped_column(default=False)
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))


class WorkspaceMember(Base):
    """Somebody's role in a workspace; it holds for all its studies."""

    __tablename__ = "workspace_members"
    __table_args__ = (one_of("role", *ROLES),)

    workspace_id: Mapped[int] = mapped_column(
        ForeignKey("workspaces.id", ondelete="CASCADE"), primary_key=True
    )
    account_id: Mapped[int] = mapped_column(
        ForeignKey("accounts.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    role: Mapped[str] = mapped_column(String(20))
    added_at: Mapped[datetime] = mapped_column(default=now)


class StudyGrant(Base):
    """A right on one study, given to somebody whether she belongs to its workspace or not."""

    __tablename__ = "study_grants"
    __table_args__ = (one_of("granted", *RIGHTS),)

    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"), primary_key=True)
    account_id: Mapped[int] = mapped_column(
        ForeignKey("accounts.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    granted: Mapped[str] = mapped_column(String(10), primary_key=True)
    granted_at: Mapped[datetime] = mapped_column(default=now)
    granted_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
