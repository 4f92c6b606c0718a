"""Names within one declaration: each stands once, and none is a column of the export."""

from collections.abc import Iterable, Sequence


def refuse_repeats(names: Sequence[str], what: str) -> None:
    """ValueError where a name stands twice; `what` says whose names they are."""
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ValueError(f"each {what} needs a name of its own; '{repeated[0]}' stands twice")


def refuse_reserved(names: Iterable[str], reserved: frozenset[str]) -> None:
    """ValueError where a factor has the name of a column that stands beside it in the export."""
    for name in names:
        if name in reserved:
            raise ValueError(f"factor '{name}' has the name of a ratings column; choose another")
