"""What the server does for each kind of trial: a file of its name here, with `SERVED`.

Nothing else joins them: the name in the declaration finds the file.
"""

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol, TypeVar, get_args

from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import Answer
from server.core.errors import Invalid
from server.participation.answer_schemas import Part, RatingIn
from server.participation.tallies import NumberedClip, TallyEntry
from server.participation.verdict import Ruling
from server.participation.versions import LoadedVersion


class Preference(Protocol):
    """A simulated person. Called: how well they like the clip with this hash, 0 being neutral."""

    def __call__(self, clip: str, /) -> float:
        """How well they like it."""

    def sees(self, clip: str, /) -> float:
        """How likely they say yes to it, or name it rightly: their psychometric function."""

    def blinks(self, clip: str, /) -> Sequence[float]:
        """When the blinks of its performance begin, in s; none of other clips."""


def asked_in(prompt: str) -> int:
    """The number that the prompt of an attention check asks for."""
    # Stars are the bold type of Markdown.
    return next(int(word) for word in prompt.replace("*", " ").split() if word.isdigit())


@dataclass(frozen=True)
class ServedKind:
    """A kind of trial in the server.

    Attributes
    ----------
    validate : callable
        Refuses (by an `Invalid`) an answer that the declaration does not allow in this part.
    judge : callable
        The verdict on the views of the clips with these ids by role (none for an attention check), by the
        declared playback rules.
    simulated : callable
        The answer of a simulated person to a trial as the page gets it, with the declaration as the page gets
        it.
    counted : callable
        What Results counts of a stored answer to a main trial, given the numbers of its clips by role; empty
        where there is no answer.
    """

    validate: Callable[[Experiment, Part, RatingIn], None]
    judge: Callable[[LoadedVersion, Mapping[str, int], RatingIn], Ruling]
    simulated: Callable[[Preference, Mapping[str, Any], Mapping[str, Any], random.Random], dict[str, Any]]
    counted: Callable[[Mapping[str, NumberedClip], Mapping[str, Any]], Iterable[TallyEntry]]


class AnswerOfOtherKind(Invalid, code="answer_of_other_kind"):
    """The answer belongs to trials of another kind than the study's."""


A = TypeVar("A", bound=Answer)


def answer_of(rating: RatingIn, model: type[A]) -> A:
    """The answer, which is one of this kind; AnswerOfOtherKind where it is not."""
    if not isinstance(rating.answer, model):
        # The kind is a literal type, whose one argument is the name.
        kind = str(get_args(model.model_fields["kind"].annotation)[0])
        raise AnswerOfOtherKind(
            f"Expected an answer of the kind {kind}, as this study declares it; got {rating.answer.kind}."
        )
    return rating.answer


_SERVED: dict[str, ServedKind] = {}


def served_kind(kind: str) -> ServedKind:
    """What the server does for trials of this kind."""
    if kind not in _SERVED:
        # Decision 0322: kinds are found by their names. Imported at first use, since they import this module.
        _SERVED[kind] = import_module(f"server.participation.kinds.{kind}").SERVED
    return _SERVED[kind]
