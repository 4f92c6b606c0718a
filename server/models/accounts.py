"""Experimenters: accounts, sessions, tokens, logins, workspaces, the audit log; long jobs."""

from datetime import datetime
from typing import Any, Literal, get_args

from sqlalchemy import ForeignKey, Index, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from server.core.values import ROLES, now
from server.models.base import Base, one_of

# Experimenters: accounts, sessions, API tokens, the audit log; and long jobs.


class Account(Base):
    """A person who runs studies. Passwords are argon2 hashes; recovery codes are hashed too.

    Attributes
    ----------
    role : str
        On the server itself. Owners manage accounts and workspaces and read the audit log, experimenters may
        make workspaces, viewers neither. What somebody may do with studies is the workspaces' to say.
    """

    __tablename__ = "accounts"
    __table_args__ = (one_of("role", *ROLES),)

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(100), unique=True)
    email: Mapped[str | None] = mapped_column(String(200))
    password_hash: Mapped[str] = mapped_column(String(300))
    role: Mapped[str] = mapped_column(String(20))
    totp_secret: Mapped[str | None] = mapped_column(String(300))
    totp_confirmed_at: Mapped[datetime | None]
    totp_last_step: Mapped[int | None]
    recovery_code_hashes: Mapped[list[str]] = mapped_column(default=list)
    disabled_at: Mapped[datetime | None]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Invitation(Base):
    """A one-time link to create an account, the first owner's included; only the token's hash is stored.

    Attributes
    ----------
    role : str
        On the server.
    workspace_id, workspace_role : int or None, str or None
        Where the account will belong, and as what; the default workspace, and the same role, where not given.
    """

    __tablename__ = "invitations"
    __table_args__ = (one_of("role", *ROLES),)

    id: Mapped[int] = mapped_column(primary_key=True)
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    role: Mapped[str] = mapped_column(String(20))
    label: Mapped[str] = mapped_column(String(200), default="")
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
    expires_at: Mapped[datetime]
    used_at: Mapped[datetime | None]
    workspace_id: Mapped[int | None] = mapped_column(ForeignKey("workspaces.id"))
    workspace_role: Mapped[str | None] = mapped_column(String(20))


class AdminSession(Base):
    """A signed-in browser. The cookie's token is stored hashed. No internet address is stored.

    Attributes
    ----------
    provider : str or None
        Who signed it in (`server.accounts.provider_sign_in`) and may so sign it out; None for a password.
    """

    __tablename__ = "admin_sessions"

    id: Mapped[int] = mapped_column(primary_key=True)
    account_id: Mapped[int] = mapped_column(ForeignKey("accounts.id", ondelete="CASCADE"), index=True)
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    second_factor: Mapped[bool] = mapped_column(default=False)
    user_agent: Mapped[str] = mapped_column(String(300), default="")
    created_at: Mapped[datetime] = mapped_column(default=now)
    last_seen_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime]
    revoked_at: Mapped[datetime | None]
    provider: Mapped[str | None] = mapped_column(String(30))

    account: Mapped[Account] = relationship()


class ApiToken(Base):
    """A token for scripts, limited to `scopes`."""

    __tablename__ = "api_tokens"

    id: Mapped[int] = mapped_column(primary_key=True)
    account_id: Mapped[int] = mapped_column(ForeignKey("accounts.id", ondelete="CASCADE"), index=True)
    name: Mapped[str] = mapped_column(String(100))
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    scopes: Mapped[list[str]] = mapped_column(default=list)
    created_at: Mapped[datetime] = mapped_column(default=now)
    last_used_at: Mapped[datetime | None]
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]

    account: Mapped[Account] = relationship()


class AuditEntry(Base):
    """Who did what and when; rows are only ever added, and chained by hashes (`server.accounts.audit`).

    Attributes
    ----------
    position : int or None
        In the chain; None for rows from before there was one.
    details_salt : str or None
        None where the details were erased with a person.
    """

    __tablename__ = "audit_entries"
    __table_args__ = (
        Index("ix_audit_entries_target_kind_target", "target_kind", "target"),
        Index("ix_audit_entries_position", "position", unique=True),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime] = mapped_column(default=now, index=True)
    account_id: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
    actor: Mapped[str] = mapped_column(String(100))
    action: Mapped[str] = mapped_column(String(60))
    target_kind: Mapped[str] = mapped_column(String(30), default="")
    target: Mapped[str] = mapped_column(String(200), default="")
    details: Mapped[dict[str, Any]] = mapped_column(default=dict)
    position: Mapped[int | None]
    details_salt: Mapped[str | None] = mapped_column(String(32))
    details_digest: Mapped[str | None] = mapped_column(String(64))
    chain_hash: Mapped[str | None] = mapped_column(String(64))


class Job(Base):
    """Long work done by a separate process, such as a study's analysis report."""

    __tablename__ = "jobs"
    __table_args__ = (one_of("status", "queued", "running", "done", "failed", "cancelled"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    public_id: Mapped[str] = mapped_column(String(32), unique=True)
    kind: Mapped[str] = mapped_column(String(30))
    study_id: Mapped[int | None] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"), index=True)
    status: Mapped[str] = mapped_column(String(10), default="queued")
    progress: Mapped[float] = mapped_column(default=0.0)
    message: Mapped[str] = mapped_column(Text, default="")
    parameters: Mapped[dict[str, Any]] = mapped_column(default=dict)
    result: Mapped[dict[str, Any] | None]
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]


# Workspaces: the laboratories of one server, who belongs to them, and rights on single studies.

Right = Literal["view", "run", "edit", "export", "own"]
RIGHTS: tuple[Right, ...] = get_args(Right)
"""What may be done with a study; see `server.accounts.workspace_repository`."""
DEFAULT_WORKSPACE = "default"
"""Name of the workspace that holds whatever is put into no other."""


class Workspace(Base):
    """A laboratory: its people and its studies.

    Attributes
    ----------
    second_factor_required : bool
        Its studies open only to people who signed in with a second factor.
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


# Signing in by a university's or ORCID's own service: whom its subjects are here, and sign-ins under way.

Purpose = Literal["sign in", "link", "code"]
PURPOSES: tuple[Purpose, ...] = get_args(Purpose)


class AccountLogin(Base):
    """A subject of an issuer, and the account that it signs in to; nothing else recognizes anybody.

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
        `code`: the provider has recognized the account, whose second factor is asked for still.
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


# One-time links that were sent by mail.

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
