"""The rules of workspaces: who may put a study where, who manages members and grants."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from server.accounts import repository as accounts
from server.accounts import workspace_repository
from server.accounts.access import WRITER, Writer, account_of
from server.accounts.audit import record
from server.accounts.identity import Identity, NotAllowed, Operator, must_be_fresh
from server.accounts.schemas import GrantOut, MemberOut, WorkspaceOut
from server.accounts.workspace_repository import ordered_rights
from server.core.db import Database
from server.core.errors import Conflict, Invalid, NotFound
from server.core.requests import DatabaseDep
from server.core.row_security import every_row
from server.core.settings import Settings
from server.models import DEFAULT_WORKSPACE, Account, Right, Role, Study, Workspace

# The rules of workspaces: who may put a study where, who manages members and grants.


@dataclass(frozen=True)
class Membership:
    """Where an account belongs, and as what."""

    workspace: Workspace
    role: Role


@dataclass(frozen=True)
class Standing:
    """Where a study belongs, and what the one who asks may do with it."""

    workspace: str
    rights: list[Right]


def standing_of(session: Session, studies: Sequence[Study], identity: Identity) -> dict[int, Standing]:
    """Study number -> its workspace and her rights."""
    names = {workspace.id: workspace.name for workspace in workspace_repository.every_workspace(session)}
    rights = workspace_repository.rights_on(session, studies, identity)
    return {
        study.id: Standing(names.get(study.workspace_id or 0, ""), ordered_rights(rights[study.id]))
        for study in studies
    }


def standing_on(session: Session, study: Study, rights: frozenset[Right]) -> Standing:
    """Where one study belongs, with the rights on it that are known."""
    workspace = workspace_repository.workspace_of(session, study)
    return Standing(workspace.name if workspace else "", ordered_rights(rights))


def find_workspace(session: Session, name: str, *, lock: bool = False) -> Workspace:
    """The workspace called `name`, for managers of the server."""
    workspace = workspace_repository.find_workspace(session, name, lock=lock)
    if workspace is None:
        if name == DEFAULT_WORKSPACE:
            return workspace_repository.default_workspace(session)
        names = [one.name for one in workspace_repository.every_workspace(session)]
        raise NotFound(f"There is no workspace '{name[:60]}'{did_you_mean(name, names)}")
    return workspace


def workspace_for(session: Session, identity: Identity, name: str | None) -> Workspace:
    """Where a new study goes: the workspace named, or the only one (else the default one) she may use."""
    open_ones = {one.name: one for one in workspace_repository.workspaces_for_new_studies(session, identity)}
    if not open_ones:
        raise NotAllowed("This requires the role experimenter in a workspace, but you do not have it in any.")
    if name is not None:
        if name not in open_ones:
            raise NotFound(f"There is no workspace '{name[:60]}' in which you may create studies.")
        return open_ones[name]
    if len(open_ones) == 1:
        return next(iter(open_ones.values()))
    if DEFAULT_WORKSPACE in open_ones:
        return open_ones[DEFAULT_WORKSPACE]
    raise Invalid(f"Specify the workspace: {', '.join(open_ones)}.")


def place_of_copy(session: Session, study: Study, identity: Identity, name: str | None) -> Workspace:
    """Where a copy of a study goes: into the named workspace, else into that of its source.

    Invalid if the account may not make studies there and names no other: a copy opens the declaration to
    another laboratory, which nothing but her word does.
    """
    own = {one.id: one for one in workspace_repository.workspaces_for_new_studies(session, identity)}
    if name is not None or not own:
        return workspace_for(session, identity, name)
    if study.workspace_id not in own:
        names = ", ".join(one.name for one in own.values())
        raise Invalid(
            f"You may not create studies in the workspace of '{study.name}'. Specify a workspace for the "
            f"copy: {names}."
        )
    return own[study.workspace_id]


def own_workspaces(session: Session, account_id: int) -> list[tuple[Workspace, Role]]:
    """The workspaces an account belongs to, by name, with its role in each."""
    return workspace_repository.workspaces_of(session, account_id)


def list_workspaces(session: Session, identity: Identity) -> list[WorkspaceOut]:
    """The workspaces she belongs to; all of them where she manages the server."""
    roles = workspace_repository.roles_of(session, identity.account_id)
    with every_row(session):  # numbers alone; of workspaces that are not shown they are not used
        counts = workspace_repository.counts(session)
    return [
        WorkspaceOut(
            name=one.name,
            title=one.title,
            second_factor_required=one.second_factor_required,
            role=roles.get(one.id),
            members=counts.get(one.id, (0, 0))[0],
            studies=counts.get(one.id, (0, 0))[1],
        )
        for one in workspace_repository.every_workspace(session)
        if one.id in roles or identity.role == "owner"
    ]


def members(session: Session, workspace: Workspace) -> list[MemberOut]:
    """Who belongs to a workspace."""
    return [
        MemberOut(
            account=account.name,
            role=role,
            second_factor=account.totp_confirmed_at is not None,
            disabled=account.disabled_at is not None,
        )
        for account, role in workspace_repository.members(session, workspace)
    ]


def grants_on(session: Session, study: Study) -> list[GrantOut]:
    """The rights granted on a study."""
    given = workspace_repository.grants(session, study)
    return [GrantOut(account=name, rights=rights) for name, rights in given.items()]


def managed_workspace(session: Session, name: str, identity: Identity | Operator) -> Workspace:
    """A workspace she may manage: her own, or any where she manages the server.

    One that asks for a second factor is managed by nobody without, the server's owners included; the command
    line needs none. The row is held until the transaction ends, so that two owners do not take each other out
    at once.
    """
    if isinstance(identity, Operator):
        return find_workspace(session, name, lock=True)
    workspace = (
        find_workspace(session, name, lock=True)
        if identity.role == "owner"
        else _owned_workspace(session, name, identity)
    )
    if workspace.second_factor_required and not identity.second_factor:
        raise NotAllowed(f"The workspace '{name}' requires a second factor. Set one up under My account.")
    return workspace


def _owned_workspace(session: Session, name: str, identity: Identity) -> Workspace:
    workspace = workspace_repository.find_workspace(session, name, lock=True)
    role = (
        workspace_repository.roles_of(session, identity.account_id).get(workspace.id)
        if workspace is not None
        else None
    )
    if workspace is None or role is None:
        raise NotFound(f"There is no workspace '{name[:60]}'.")
    if role != "owner":
        raise NotAllowed(f"This requires the role owner in the workspace '{name}'; yours is {role}.")
    return workspace


def create(session: Session, name: str, title: str, identity: Identity | Operator) -> Workspace:
    """Make a workspace; the account that makes it owns it."""
    if workspace_repository.find_workspace(session, name) is not None:
        raise Conflict(f"A workspace called '{name}' already exists. Choose another name.")
    workspace = Workspace(name=name, title=title, created_by=identity.account_id)
    session.add(workspace)
    session.flush()
    record(session, identity, "workspace made", "workspace", name)
    if isinstance(identity, Identity):
        workspace_repository.set_member(session, workspace, account_of(session, identity), "owner")
    return workspace


def change(
    session: Session, workspace: Workspace, title: str, second_factor_required: bool, identity: Identity
) -> None:
    """Give a workspace another title, or ask its people for a second factor.

    No longer to ask for one needs a sign-in of a short while ago: it would outlive a stolen session.
    """
    if workspace.second_factor_required and not second_factor_required:
        must_be_fresh(identity)
    if second_factor_required and not identity.second_factor:
        raise Conflict("Set up your own second factor first; otherwise you would lock yourself out.")
    workspace.title, workspace.second_factor_required = title, second_factor_required
    record(
        session, identity, "workspace changed", "workspace", workspace.name,
        title=title, second_factor_required=second_factor_required,
    )  # fmt: skip


def delete(session: Session, workspace: Workspace, identity: Identity) -> None:
    """Remove a workspace that holds no study."""
    with every_row(session):
        _, studies = workspace_repository.counts(session).get(workspace.id, (0, 0))
    if studies:
        raise Conflict("The workspace contains studies. Move them to another workspace first.")
    if workspace.name == DEFAULT_WORKSPACE:
        raise Conflict("The default workspace cannot be deleted, but you can change its title.")
    record(session, identity, "workspace deleted", "workspace", workspace.name)
    workspace_repository.delete_workspace(session, workspace)


def account_named(session: Session, name: str) -> Account:
    """The account of this name; NotFound where there is none (names are not guessed at)."""
    account = accounts.account_named(session, name)
    if account is None:
        raise NotFound(f"There is no account '{name[:100]}'; invite the person first.")
    return account


def set_member(
    session: Session, workspace: Workspace, name: str, role: Role | None, identity: Identity | Operator
) -> None:
    """Take somebody into a workspace, change her role, or (None) take her out; one owner must remain."""
    account = account_named(session, name)
    owners = workspace_repository.number_of_owners(session, workspace)
    if role is not None:
        workspace_repository.set_member(session, workspace, account, role)
    elif not workspace_repository.remove_member(session, workspace, account):
        raise NotFound(f"'{name[:100]}' does not belong to the workspace '{workspace.name}'.")
    if owners and not workspace_repository.number_of_owners(session, workspace):
        raise Conflict("At least one owner must remain. Make another member an owner first.")
    action = "member removed" if role is None else "member set"
    record(session, identity, action, "workspace", workspace.name, account=account.name, role=role)


def grant(
    session: Session, study: Study, name: str, rights: Sequence[Right], identity: Identity | Operator
) -> None:
    """Give somebody exactly these rights on a study in addition to those of their role.

    None takes them all back.
    """
    account = account_named(session, name)
    workspace_repository.set_grants(session, study, account, rights, identity.account_id)
    record(
        session,
        identity,
        "rights granted",
        "study",
        study.name,
        account=account.name,
        rights=ordered_rights(rights),
    )


def move(session: Session, study: Study, workspace: Workspace, identity: Identity | Operator) -> None:
    """Put a study into another workspace; grants stay."""
    study.workspace_id = workspace.id
    record(session, identity, "study moved", "study", study.name, workspace=workspace.name)


# Who may send clips: recognized before the body of an upload is read.


def _must_make_studies(database: Database, identity: Identity) -> Identity:
    with database.read() as session:
        if not workspace_repository.may_upload(session, identity):
            raise NotAllowed(
                "This requires the role experimenter in a workspace, but you do not have it in any."
            )
    return identity


def recognise_uploader(request: Request, database: Database, settings: Settings) -> Identity:
    """The account behind an upload; NotSignedIn or NotAllowed where it may send none."""
    return _must_make_studies(database, WRITER(request, database, settings, None, None))


def _uploader(database: DatabaseDep, identity: Writer) -> Identity:
    return _must_make_studies(database, identity)


Uploader = Annotated[Identity, Depends(_uploader)]
"""May make studies somewhere, or edit one."""
