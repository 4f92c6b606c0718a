"""What the endpoints of workspaces and grants take and give."""

from typing import Annotated

from pydantic import BaseModel, Field, StringConstraints

from server.models import Right, Role
from server.request_body import RequestBody

WorkspaceName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,59}$")]
Title = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]


class NewWorkspace(RequestBody):
    """A workspace: its name in addresses, and the title people read."""

    name: WorkspaceName
    title: Title


class ChangeWorkspace(RequestBody):
    """What an owner may change of a workspace."""

    title: Title
    second_factor_required: bool


class WorkspaceOut(BaseModel):
    """A workspace, and the role of the account that asks; null where it is no member."""

    name: str
    title: str
    second_factor_required: bool
    role: Role | None
    members: int
    studies: int


class MemberOut(BaseModel):
    """Somebody who belongs to a workspace."""

    account: str
    role: Role
    second_factor: bool
    disabled: bool


class SetMember(RequestBody):
    """The role somebody shall have in a workspace."""

    role: Role


class GrantOut(BaseModel):
    """Rights on a study that were granted to an account, beside those of its role in the workspace."""

    account: str
    rights: list[Right]


class SetGrant(RequestBody):
    """The rights an account shall have on a study beside those of its role; an empty list takes them back."""

    rights: Annotated[list[Right], Field(max_length=5)]


class MoveStudy(RequestBody):
    """Where a study shall belong."""

    workspace: Annotated[str, StringConstraints(max_length=60)]
