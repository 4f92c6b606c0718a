"""The [trial] of any kind, and the answer to a motion check, which studies of every kind have."""

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated, Literal, Self

from pydantic import Field, StrictInt, model_validator

from experiments.declaration.trial import Answer, ByKind, TrialDeclaration

# The [trial] of every kind, and the type of a [trial] that is of any of them.

DEFAULT_KIND = "clip_rating"
"""What a [trial] that names no kind is."""


def kind_names() -> list[str]:
    """The kinds of trial, the default first: files of the same name here and in `experiments.kinds`."""
    here = Path(__file__).parent
    declared, done = (
        {module.name for module in iter_modules([str(folder)])} for folder in (here, here.parent / "kinds")
    )
    return sorted(declared & done, key=lambda name: (name != DEFAULT_KIND, name))


def _trial_in(kind: str) -> type[TrialDeclaration]:
    """The class of a kind's file that the kind's [trial] is."""
    module = import_module(f"experiments.declaration.{kind}")
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, TrialDeclaration):
            field = value.model_fields.get("kind")
            if field is not None and field.default == kind:
                return value
    raise TypeError(f"{module.__name__}: expected a TrialDeclaration whose kind is '{kind}', found none")


TRIALS: dict[str, type[TrialDeclaration]] = {kind: _trial_in(kind) for kind in kind_names()}
"""Every kind's declaration by the name that a TOML gives it; the first is meant where none is given."""

AnyTrial = Annotated[TrialDeclaration, ByKind(lambda: TRIALS, implied=True)]


# The answer to a motion check, the same in studies of every kind of trial.

MAX_CHOICES = 9
"""A key each."""


class CheckAnswer(Answer):
    """The number of the choice; none where the clip could not be shown, or the other way was taken."""

    kind: Literal["check"]
    check: Annotated[StrictInt, Field(ge=1, le=MAX_CHOICES)] | None
    """Number of the choice, from 1."""
    other_way: bool = False
    """True where the way around was taken that the study offers."""

    @property
    def given(self) -> bool:
        """True where the check itself was answered."""
        return self.check is not None

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if self.other_way and self.check is not None:
            raise ValueError(f"expected a choice or the other way, got both: {self.check}")
        return self
