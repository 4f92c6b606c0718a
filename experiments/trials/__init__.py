"""The kinds of trial, a folder each, and the registry that finds them by name.

A new kind is a folder here, its line in `KINDS`, and a file or folder of its name in `server/trials/kinds`,
`frontend/src/participant/trials` and `analysis/plans`.
"""

from experiments.columns.view import View
from experiments.trials.clip_rating import CLIP_RATING
from experiments.trials.continuous_rating import CONTINUOUS_RATING
from experiments.trials.kind import Kind
from experiments.trials.paired_comparison import PAIRED_COMPARISON
from experiments.trials.threshold import THRESHOLD

KINDS: dict[str, Kind] = {
    kind.name: kind for kind in (CLIP_RATING, PAIRED_COMPARISON, THRESHOLD, CONTINUOUS_RATING)
}
"""Every kind by the name that a TOML gives it; the first is meant where none is given."""


def views() -> tuple[View, ...]:
    """The SQL views of all kinds, which migrations make and a test compares with the database's own."""
    return tuple(kind.view for kind in KINDS.values())


def reserved_names() -> frozenset[str]:
    """Names that no factor may have: they are columns beside it."""
    return frozenset(name for view in views() for name in view.names)
