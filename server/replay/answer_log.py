"""Views rebuilt from an answer's own log, for runs that are older than the ledger of views."""

from collections.abc import Mapping, Sequence

from server.replay.schemas import FrameLog, ReplayedView

Log = list[tuple[int, float]]
AT_ONCE = {"left", "right"}
"""Roles that one clock draws."""


def showings_of(drawn: Sequence[Sequence[float]]) -> list[Log]:
    """The log of an answer, cut where a clip begins anew: where the frame's index falls.

    >>> showings_of([[0, 10.0], [1, 43.0], [0, 9.0], [2, 75.0]])
    [[(0, 10.0), (1, 43.0)], [(0, 9.0), (2, 75.0)]]
    """
    logs: list[Log] = []
    for index, ms in drawn:
        if not logs or index <= logs[-1][-1][0]:
            logs.append([])
        logs[-1].append((int(index), float(ms)))
    return logs


def groups_of(roles: Sequence[str]) -> list[list[str]]:
    """The roles of a trial, those together that are shown at once, in the order of showing.

    >>> groups_of(["reference", "left", "right"])
    [['reference'], ['left', 'right']]
    >>> groups_of(["second", "first", "reference"])
    [['reference'], ['first'], ['second']]
    """
    order = ("reference", "first", "left", "right", "second", "shown")
    groups: list[list[str]] = []
    for role in sorted(roles, key=order.index):
        if groups and {groups[-1][-1], role} <= AT_ONCE:
            groups[-1].append(role)
        else:
            groups.append([role])
    return groups


def rebuilt_views(drawn: Sequence[Sequence[float]], clips: Mapping[str, str]) -> list[ReplayedView]:
    """The views of a play from what its answer says was drawn.

    Parameters
    ----------
    drawn : sequence of (int, float)
        Index and time in ms since the start key of every drawn frame, view after view.
    clips : mapping of str to str
        The trial's clips: role to hash.
    """
    groups, logs = groups_of(list(clips)), showings_of(drawn)
    if not groups:
        return []
    return [
        _view(start // len(groups) + 1, groups, logs[start : start + len(groups)], clips)
        for start in range(0, len(logs), len(groups))
    ]


def _view(
    number: int, groups: Sequence[Sequence[str]], logs: Sequence[Log], clips: Mapping[str, str]
) -> ReplayedView:
    seen = [
        FrameLog.model_validate({"role": role, "clip_sha256": clips[role], "drawn": log})
        for group, log in zip(groups, logs, strict=False)
        for role in group
    ]
    return ReplayedView(
        number=number,
        from_answer=True,
        started_at_client=None,
        ended_at_client=None,
        outcome=None,
        screen={},
        showings=None,
        clips=seen,
        disturbances={},
    )
