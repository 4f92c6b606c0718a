"""Who is let in that has no login here yet: by a rule of the declared provider, or by an invitation."""

import re
from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from server.accounts import repository as accounts
from server.accounts.invitations import invited_account
from server.accounts.service import add_account
from server.errors import ApiError, Conflict
from server.models import DEFAULT_WORKSPACE, Account, AccountLogin, Invitation, Workspace
from server.providers.declaration import Provider
from server.providers.logins import NO_PASSWORD, add_login
from server.providers.protocol import Recognised
from server.providers.roles import roles_by_claims
from server.workspaces.service import Membership

_NOT_IN_A_NAME = re.compile(r"[^\w.@+ -]+")
MAX_NAME = 90


class NotAdmitted(ApiError):
    """The provider knows her, this server does not."""

    status = 403
    code = "not_admitted"


def new_account(
    session: Session, provider_id: str, provider: Provider, whom: Recognised, held: Mapping[str, Workspace]
) -> Account:
    """The account of somebody new, where a rule gives her a place; NotAdmitted where none does."""
    given = roles_by_claims(provider, whom.claims)
    membership = next((Membership(held[name], role) for name, role in given.items() if name in held), None)
    if membership is None:
        raise NotAdmitted("Nobody here belongs to this login yet: sign in by password and add it, or ask.")
    name = _free_name(session, whom.claims, provider.label)
    account = add_account(session, name, NO_PASSWORD, "viewer", membership)
    add_login(session, provider_id, account, whom)
    return account


def account_by_invitation(
    session: Session,
    provider_id: str,
    provider: Provider,
    invitation_hash: str,
    whom: Recognised,
    login: AccountLogin | None,
) -> Account:
    """The account that somebody makes by her invitation, without a password."""
    if login is not None:
        raise Conflict("This login belongs to an account of this server already: sign in by it.")
    invitation = accounts.invitation_by_token(session, invitation_hash)
    if invitation is not None:
        check_no_rule_decides(session, provider, invitation)
    name = _free_name(session, whom.claims, provider.label)
    account = invited_account(session, invitation, name, NO_PASSWORD)
    add_login(session, provider_id, account, whom)
    return account


def check_no_rule_decides(session: Session, provider: Provider, invitation: Invitation) -> None:
    """Conflict where the provider's rules decide in the invitation's workspace: they would take it back."""
    workspace = accounts.workspace_of(session, invitation)
    name = workspace.name if workspace else DEFAULT_WORKSPACE
    if any(rule.workspace == name for rule in provider.roles):
        raise Conflict(
            f"{provider.label} says who belongs to the workspace '{name}', not an invitation: sign in with it"
            " without the invitation, or make the account with a password."
        )


def _free_name(session: Session, claims: Mapping[str, Any], otherwise: str) -> str:
    """A name that nobody has, made of what the provider calls her."""
    told = next(
        (claims[key] for key in ("preferred_username", "name") if isinstance(claims.get(key), str)), ""
    )
    plain = " ".join(_NOT_IN_A_NAME.sub(" ", told).split())[:MAX_NAME]
    name = plain if len(plain) > 1 else f"{_NOT_IN_A_NAME.sub(' ', otherwise).strip()} user"
    number, free = 1, name
    while accounts.account_named(session, free) is not None:
        number += 1
        free = f"{name} {number}"
    return free
