"""Types that are of whichever kind their key `kind` names: what a page gets, an answer."""

from typing import Annotated

from experiments.base import Declaration
from experiments.trials import KINDS
from experiments.trials.check import CheckAnswer
from experiments.trials.declared import Answer, ByKind

AnyPage = Annotated[Declaration, ByKind(lambda: {name: kind.page for name, kind in KINDS.items()})]
AnyAnswer = Annotated[
    Answer, ByKind(lambda: {**{name: kind.answer for name, kind in KINDS.items()}, "check": CheckAnswer})
]
