"""The kinds of trial, and the registry that finds them by name.

A new kind is its [trial] in `experiments.declaration`, its file here, and its line in `KINDS` and `TRIALS`.
"""

from typing import Annotated

from experiments.columns.view import View
from experiments.declaration.any_trial import CheckAnswer
from experiments.declaration.base import Declaration
from experiments.declaration.trial import Answer, ByKind
from experiments.kinds.clip_rating import CLIP_RATING
from experiments.kinds.continuous_rating import CONTINUOUS_RATING
from experiments.kinds.kind import Kind
from experiments.kinds.paired_comparison import PAIRED_COMPARISON
from experiments.kinds.threshold import THRESHOLD

KINDS: dict[str, Kind] = {
    kind.name: kind for kind in (CLIP_RATING, PAIRED_COMPARISON, THRESHOLD, CONTINUOUS_RATING)
}
"""Every kind by the name that a TOML gives it; the first is meant where none is given."""


def views() -> tuple[View, ...]:
    """The SQL views of all kinds, which every upgrade makes (`server.core.database_views`)."""
    return tuple(kind.view for kind in KINDS.values())


def reserved_names() -> frozenset[str]:
    """Names that no factor may have: they are columns beside it."""
    return frozenset(name for view in views() for name in view.names)


# Types that are of whichever kind their key `kind` names: what a page gets, an answer.

AnyPage = Annotated[Declaration, ByKind(lambda: {name: kind.page for name, kind in KINDS.items()})]
AnyAnswer = Annotated[
    Answer, ByKind(lambda: {**{name: kind.answer for name, kind in KINDS.items()}, "check": CheckAnswer})
]
