"""Queries of workspaces, their members and grants; which studies somebody may see, and with which rights."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from typing import Final

from sqlalchemy import ColumnElement, Select, delete, func, select, true
from sqlalchemy.orm import Session

from server.accounts.identity import Identity, Operator
from server.core.repository import insert_once
from server.models import (
    DEFAULT_WORKSPACE,
    RIGHTS,
    ROLES,
    Account,
    Invitation,
    Right,
    Role,
    Study,
    StudyGrant,
    Workspace,
    WorkspaceMember,
)

# What somebody may do with a study: five rights, from the role in its workspace and from grants.
#
# view: the study, its progress, its results and the list of its reports, no single person.
# run: links, status, settings, exclusions, the making of reports and capsules, the deletion of capsules.
# edit: versions, deletion of drafts, erasure of persons.
# export: downloads, the files of reports and capsules, and the answers of single persons.
# own: recruiters' IDs, grants, the workspace a study belongs to; an owner of a study may do all of it.

OF_ROLE: Final[dict[Role, frozenset[Right]]] = {
    "viewer": frozenset({"view", "export"}),
    "experimenter": frozenset({"view", "run", "edit", "export"}),
    "owner": frozenset(RIGHTS),
}
"""What a role in a workspace lets somebody do with its studies."""
MAKING_STUDIES: Final[tuple[Role, ...]] = ("experimenter", "owner")
"""The roles that may make studies in a workspace."""


def effective_rights(role: Role | None, granted: Iterable[Right]) -> frozenset[Right]:
    """The rights on a study of one with this role in its workspace and these grants.

    >>> sorted(effective_rights(None, ["run"]))
    ['run', 'view']
    >>> effective_rights("viewer", ["own"]) == frozenset(RIGHTS)
    True
    >>> effective_rights(None, [])
    frozenset()
    """
    rights = (OF_ROLE[role] if role is not None else frozenset[Right]()) | frozenset(granted)
    if "own" in rights:
        return frozenset(RIGHTS)
    return rights | {"view"} if rights else rights


def ordered_rights(rights: Collection[Right]) -> list[Right]:
    """Rights in the order in which they are shown.

    >>> ordered_rights({"own", "view"})
    ['view', 'own']
    """
    return [one for one in RIGHTS if one in rights]


# Queries of workspaces, their members and grants; and which studies somebody may see.


def seen_by(identity: Identity | Operator) -> ColumnElement[bool]:
    """Holds for the studies that somebody may see: of her workspaces, or granted to her."""
    if isinstance(identity, Operator):
        return true()
    mine = select(WorkspaceMember.workspace_id).where(WorkspaceMember.account_id == identity.account_id)
    granted = select(StudyGrant.study_id).where(StudyGrant.account_id == identity.account_id)
    return Study.workspace_id.in_(mine) | Study.id.in_(granted)


def opened_to(identity: Identity | Operator) -> ColumnElement[bool]:
    """As `seen_by`, without the studies that wait for a second factor."""
    if isinstance(identity, Operator) or identity.second_factor:
        return seen_by(identity)
    closed = select(Workspace.id).where(Workspace.second_factor_required.is_(True))
    return seen_by(identity) & (Study.workspace_id.is_(None) | Study.workspace_id.not_in(closed))


def study_seen_by(session: Session, name: str, identity: Identity | Operator) -> Study | None:
    """The study called `name` where she may see it."""
    return session.scalar(select(Study).where(Study.name == name, seen_by(identity)))


def study_names_seen_by(session: Session, identity: Identity | Operator) -> Sequence[str]:
    """The names of the studies she may see."""
    return session.scalars(select(Study.name).where(seen_by(identity))).all()


def studies_opened_to(session: Session, identity: Identity | Operator) -> list[Study]:
    """The studies that are open to her, the latest first."""
    return list(session.scalars(select(Study).where(opened_to(identity)).order_by(Study.id.desc())))


def rights_on(session: Session, studies: Iterable[Study], identity: Identity) -> dict[int, frozenset[Right]]:
    """Study number -> her rights on it."""
    listed = list(studies)
    roles = roles_of(session, identity.account_id)
    granted: dict[int, set[Right]] = defaultdict(set)
    query = select(StudyGrant.study_id, StudyGrant.granted).where(
        StudyGrant.account_id == identity.account_id
    )
    for study_id, word in session.execute(query):
        granted[study_id].add(RIGHTS[RIGHTS.index(word)])
    return {one.id: effective_rights(roles.get(one.workspace_id or 0), granted[one.id]) for one in listed}


def roles_of(session: Session, account_id: int) -> dict[int, Role]:
    """Workspace number -> the account's role in it."""
    query = select(WorkspaceMember.workspace_id, WorkspaceMember.role)
    rows = session.execute(query.where(WorkspaceMember.account_id == account_id))
    return {workspace: ROLES[ROLES.index(role)] for workspace, role in rows}


def workspaces_of(session: Session, account_id: int) -> list[tuple[Workspace, Role]]:
    """The workspaces an account belongs to, by name, with its role in each."""
    query = select(Workspace, WorkspaceMember.role).join(WorkspaceMember)
    rows = session.execute(query.where(WorkspaceMember.account_id == account_id).order_by(Workspace.name))
    return [(workspace, ROLES[ROLES.index(role)]) for workspace, role in rows]


def workspace_of(session: Session, study: Study) -> Workspace | None:
    """The workspace of a study."""
    return session.get(Workspace, study.workspace_id) if study.workspace_id is not None else None


def workspaces_for_new_studies(session: Session, identity: Identity | Operator) -> list[Workspace]:
    """Where she may make studies."""
    query = select(Workspace).order_by(Workspace.id)
    if isinstance(identity, Identity):
        query = query.join(WorkspaceMember).where(
            WorkspaceMember.account_id == identity.account_id, WorkspaceMember.role.in_(MAKING_STUDIES)
        )
        if not identity.second_factor:
            query = query.where(Workspace.second_factor_required.is_(False))
    return list(session.scalars(query))


def may_upload(session: Session, identity: Identity) -> bool:
    """True where she may make studies somewhere, or edit one."""
    editing = select(StudyGrant.study_id).where(
        StudyGrant.account_id == identity.account_id, StudyGrant.granted.in_(("edit", "own"))
    )
    return bool(workspaces_for_new_studies(session, identity)) or session.scalar(editing.limit(1)) is not None


def default_workspace(session: Session) -> Workspace:
    """The workspace of whatever is put into no other; made where it is missing."""
    insert_once(session, Workspace, [{"name": DEFAULT_WORKSPACE, "title": "Laboratory"}])
    return session.scalars(_workspace_query(DEFAULT_WORKSPACE)).one()


def _workspace_query(name: str) -> Select[Workspace]:
    return select(Workspace).where(Workspace.name == name)


def find_workspace(session: Session, name: str, *, lock: bool = False) -> Workspace | None:
    """The workspace called `name`.

    Parameters
    ----------
    lock : bool, optional
        Hold it until the transaction ends.
    """
    return session.scalar(_workspace_query(name).with_for_update() if lock else _workspace_query(name))


def every_workspace(session: Session) -> list[Workspace]:
    """All workspaces by name."""
    return list(session.scalars(select(Workspace).order_by(Workspace.name)))


def counts(session: Session) -> dict[int, tuple[int, int]]:
    """Workspace number -> (members, studies)."""
    of_members = select(WorkspaceMember.workspace_id, func.count()).group_by(WorkspaceMember.workspace_id)
    of_studies = select(Study.workspace_id, func.count()).group_by(Study.workspace_id)
    members = {number: counted for number, counted in session.execute(of_members) if counted}
    studies = {number: counted for number, counted in session.execute(of_studies) if number is not None}
    return {one: (members.get(one, 0), studies.get(one, 0)) for one in members.keys() | studies.keys()}


def members(session: Session, workspace: Workspace) -> list[tuple[Account, Role]]:
    """The people of a workspace by name."""
    query = select(Account, WorkspaceMember.role).join(WorkspaceMember)
    rows = session.execute(query.where(WorkspaceMember.workspace_id == workspace.id).order_by(Account.name))
    return [(account, ROLES[ROLES.index(role)]) for account, role in rows]


def delete_workspace(session: Session, workspace: Workspace) -> None:
    """Delete a workspace without studies, and the invitations into it."""
    session.execute(delete(Invitation).where(Invitation.workspace_id == workspace.id))
    session.delete(workspace)


def set_member(session: Session, workspace: Workspace, account: Account, role: Role) -> None:
    """Take somebody in, or change her role."""
    known = session.get(WorkspaceMember, (workspace.id, account.id))
    if known is None:
        session.add(WorkspaceMember(workspace_id=workspace.id, account_id=account.id, role=role))
    else:
        known.role = role
    session.flush()


def remove_member(session: Session, workspace: Workspace, account: Account) -> bool:
    """Take somebody out; False where she was not in it."""
    known = session.get(WorkspaceMember, (workspace.id, account.id))
    if known is None:
        return False
    session.delete(known)
    session.flush()
    return True


def number_of_owners(session: Session, workspace: Workspace) -> int:
    """How many owners can still sign in."""
    query = select(func.count()).select_from(WorkspaceMember).join(Account)
    query = query.where(WorkspaceMember.workspace_id == workspace.id, WorkspaceMember.role == "owner")
    return session.scalar(query.where(Account.disabled_at.is_(None))) or 0


def grants(session: Session, study: Study) -> dict[str, list[Right]]:
    """Account name -> its grants on a study."""
    query = (
        select(Account.name, StudyGrant.granted)
        .join(StudyGrant, StudyGrant.account_id == Account.id)
        .where(StudyGrant.study_id == study.id)
    )
    listed: dict[str, list[Right]] = {}
    for name, word in session.execute(query.order_by(Account.name)):
        listed.setdefault(name, []).append(RIGHTS[RIGHTS.index(word)])
    return {name: ordered_rights(given) for name, given in listed.items()}


def set_grants(
    session: Session, study: Study, account: Account, rights: Iterable[Right], by: int | None
) -> None:
    """Give an account exactly these rights on a study, in addition to those of its role."""
    session.execute(
        delete(StudyGrant).where(StudyGrant.study_id == study.id, StudyGrant.account_id == account.id)
    )
    for right in sorted(set(rights)):
        session.add(StudyGrant(study_id=study.id, account_id=account.id, granted=right, granted_by=by))
    session.flush()
