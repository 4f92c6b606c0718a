"""Types that are of whichever kind their key `kind` names: what a page gets, an answer."""

from typing import Annotated

from experiments.declaration.any_trial import CheckAnswer
from experiments.declaration.base import Declaration
from experiments.declaration.trial import Answer, ByKind
from experiments.kinds import KINDS

AnyPage = Annotated[Declaration, ByKind(lambda: {name: kind.page for name, kind in KINDS.items()})]
AnyAnswer = Annotated[
    Answer, ByKind(lambda: {**{name: kind.answer for name, kind in KINDS.items()}, "check": CheckAnswer})
]
