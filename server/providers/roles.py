"""Where somebody belongs by what a provider says of her."""

import logging
from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from server.accounts.audit import record
from server.accounts.identity import OPERATOR
from server.models import ROLES, Account, Role, Workspace
from server.providers.declaration import Provider, RoleRule
from server.workspaces import repository as workspaces

log = logging.getLogger("palpebra")


def said_of(claims: Mapping[str, Any], name: str) -> Any:
    """A claim by its name, or by dots through nested ones (`realm_access.roles`); None where none is."""
    if name in claims:
        return claims[name]
    told: Any = claims
    for part in name.split("."):
        told = told.get(part) if isinstance(told, Mapping) else None
    return told


def rule_fits(rule: RoleRule, claims: Mapping[str, Any]) -> bool:
    """True where the claim is the value, or a list that holds it; always for a rule without one."""
    if not rule.claim:
        return True
    told = said_of(claims, rule.claim)
    return rule.value in told if isinstance(told, list) else told == rule.value


def roles_by_claims(provider: Provider, claims: Mapping[str, Any]) -> dict[str, Role]:
    """Workspace -> the highest role that a rule gives in it."""
    given: dict[str, Role] = {}
    for rule in provider.roles:
        if rule_fits(rule, claims):
            given[rule.workspace] = max(given.get(rule.workspace, rule.role), rule.role, key=ROLES.index)
    return given


def held_workspaces(session: Session, provider: Provider) -> dict[str, Workspace]:
    """Name -> workspace of those that the rules name, held until the transaction ends.

    So that two owners who go at once do not leave a workspace without any. They are taken in the order of
    their names and before anything is written, so that no two sign-ins wait for each other. A name that is
    nobody's is written to the log.
    """
    known = {}
    for name in sorted({rule.workspace for rule in provider.roles}):
        if (workspace := workspaces.find(session, name, lock=True)) is None:
            log.warning("a rule of a sign-in provider names the workspace '%s', which does not exist", name)
        else:
            known[name] = workspace
    return known


def bring_up_to_date(
    session: Session,
    provider_id: str,
    account: Account,
    given: Mapping[str, Role],
    held: Mapping[str, Workspace],
) -> None:
    """Give an account the roles that its claims give it, in the workspaces that the rules name.

    In those the provider decides: who has lost the claim loses the membership, but for a workspace's last
    owner.

    Parameters
    ----------
    given : mapping
        What `roles_by_claims` gives.
    held : mapping
        What `held_workspaces` gives, in this transaction.
    """
    present = workspaces.roles_of(session, account.id)
    for name, workspace in held.items():
        before, after = present.get(workspace.id), given.get(name)
        if before == after:
            continue
        if before == "owner" and workspaces.number_of_owners(session, workspace) == 1:
            log.warning("'%s' stays the last owner of '%s', whatever its provider says", account.name, name)
            continue
        if after is None:
            workspaces.remove_member(session, workspace, account)
        else:
            workspaces.set_member(session, workspace, account, after)
        action = "member removed" if after is None else "member set"
        record(
            session, OPERATOR, action, "workspace", name,
            account=account.name, role=after, provider=provider_id,
        )  # fmt: skip
