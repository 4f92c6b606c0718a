"""What somebody may do with a study: five rights, from the role in its workspace and from grants.

view: the study, its progress, its results and the list of its reports, no single person.
run: links, status, settings, exclusions, the making of reports and capsules, the deletion of capsules.
edit: versions, deletion of drafts, erasure of persons.
export: downloads, the files of reports and capsules, and the answers of single persons.
own: recruiters' ids, grants, the workspace a study belongs to; whoever owns a study may do all of it.
"""

from collections.abc import Collection, Iterable
from typing import Final

from server.models import RIGHTS, Right, Role

OF_ROLE: Final[dict[Role, frozenset[Right]]] = {
    "viewer": frozenset({"view", "export"}),
    "experimenter": frozenset({"view", "run", "edit", "export"}),
    "owner": frozenset(RIGHTS),
}
"""What a role in a workspace lets somebody do with its studies."""
MAKING_STUDIES: Final[tuple[Role, ...]] = ("experimenter", "owner")
"""The roles that may make studies in a workspace."""


def effective(role: Role | None, granted: Iterable[Right]) -> frozenset[Right]:
    """The rights on a study of one with this role in its workspace and these grants.

    >>> sorted(effective(None, ["run"]))
    ['run', 'view']
    >>> effective("viewer", ["own"]) == frozenset(RIGHTS)
    True
    >>> effective(None, [])
    frozenset()
    """
    rights = (OF_ROLE[role] if role is not None else frozenset[Right]()) | frozenset(granted)
    if "own" in rights:
        return frozenset(RIGHTS)
    return rights | {"view"} if rights else rights


def ordered(rights: Collection[Right]) -> list[Right]:
    """Rights in the order in which they are told.

    >>> ordered({"own", "view"})
    ['view', 'own']
    """
    return [one for one in RIGHTS if one in rights]
