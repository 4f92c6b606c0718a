"""What every kind of trial declares and answers, its scales, and the clip that it asks about."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Protocol

from pydantic import BaseModel, Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from experiments.declaration.base import Declaration, Translated
from experiments.declaration.factors import Factor


@dataclass(frozen=True)
class ClipSpec:
    """One clip of the factorial set: a level of every factor, and which exemplar of that cell (from 1)."""

    levels: tuple[tuple[str, str], ...]
    exemplar: int

    @property
    def cell(self) -> str:
        """The level names joined by slashes, in factor order."""
        return "/".join(level for _, level in self.levels)

    def level(self, factor: str) -> str:
        """Return the level this clip has of `factor`."""
        return dict(self.levels)[factor]


@dataclass(frozen=True)
class BlockSpec:
    """One block as declared: its label (a level of the split factor, or `all`) and its clips."""

    label: str
    clips: tuple[ClipSpec, ...]


@dataclass(frozen=True)
class RatedScale:
    """A scale on which every trial is rated.

    Attributes
    ----------
    name : str
        As the column `scale` of the view has it.
    type : str
        As declared: `points`, `slider`.
    minimum, maximum : float
        Ends of the range, which answers may take.
    step : float
        Between the answers that there are.
    reverse : bool
        Whether a high answer means a low value of what is measured; answers are stored as chosen.
    not_applicable : bool
        Whether "cannot say" is an answer too; it is stored without a number.
    question, low, high : Translated
        The question and the labels of the ends, by language.
    member : str
        Path of the number in the stored answer (`trial_ratings.payload`), parts joined by dots.
    """

    name: str
    type: str
    minimum: float
    maximum: float
    step: float
    reverse: bool
    not_applicable: bool
    question: Translated
    low: Translated
    high: Translated
    member: str

    def admits(self, value: float) -> bool:
        """True where `value` is an answer of this scale: in its range and on a step."""
        steps = (value - self.minimum) / self.step
        return self.minimum <= value <= self.maximum and abs(steps - round(steps)) < 1e-6

    def nearest(self, value: float) -> float:
        """The answer of this scale that is nearest to `value`, a whole number as one."""
        clipped = min(self.maximum, max(self.minimum, value))
        answer = self.minimum + round((clipped - self.minimum) / self.step) * self.step
        return int(answer) if float(answer).is_integer() else round(answer, 6)


class HasFactors(Protocol):
    """What a trial's declaration may ask of the experiment it is in: its factors."""

    @property
    def factors(self) -> tuple[Factor, ...]:
        """The factors, in declared order."""

    @property
    def factor_names(self) -> tuple[str, ...]:
        """Their names."""


class TrialDeclaration(Declaration):
    """What every kind declares; each adds its own keys, and a constant as its `kind`."""

    kind: str
    """Kind of trial."""
    expected_seconds: Annotated[float, Field(gt=0)] = 6.0
    """Average duration of a trial, in seconds. The length of a visit is computed from it."""

    def asked(self, language: str) -> str:
        """The question and its possible answers, in one line of the codebook."""
        del language
        return ""

    def rated_scales(self) -> tuple[RatedScale, ...]:
        """The scales on which each trial is rated; empty for kinds whose answers are not ratings."""
        return ()

    def rates(self, experiment: HasFactors, clip: ClipSpec) -> bool:
        """Whether trials ask about this clip; other clips of the design are only shown with it."""
        del experiment, clip
        return True

    def view_ms(self, lengths: Mapping[str, float]) -> float:
        """How long one view of a trial lasts at least, in ms, by how long its clips last by their roles.

        Clips at once last as long as the longest; a kind that shows them in turn says so.
        """
        return max(lengths.values(), default=0.0)

    def shown_ms(self, lengths: Mapping[str, float]) -> float:
        """How long all views before an answer last at least, in ms; a kind that asks for several says so."""
        return self.view_ms(lengths)


class Answer(Declaration):
    """What a participant answers to one trial; each kind adds its own keys, and a constant as its `kind`."""

    kind: str
    """Kind of the trial that is answered."""

    @property
    def given(self) -> bool:
        """True where something was answered; a clip that could not be shown goes without."""
        return any(value is not None for name, value in self if name != "kind")

    def stored(self) -> dict[str, Any]:
        """The payload of `trial_ratings`."""
        return self.model_dump(mode="json", exclude={"kind"})


class HasTrial(Protocol):
    """What may be asked of an experiment to get the trial that it declares."""

    @property
    def name(self) -> str:
        """The experiment's name, for messages."""

    @property
    def trial(self) -> TrialDeclaration:
        """What one trial shows and asks."""


@dataclass(frozen=True)
class ByKind:
    """Annotation: a union of models that is identified by `kind`, even if there is only one kind.

    Attributes
    ----------
    models : callable
        Gives the members of the union by their kind. It is called when the first schema is built, so that
        a kind that was registered before takes part.
    implied : bool
        Whether the first kind is meant where none is named.
    """

    models: Callable[[], Mapping[str, type[BaseModel]]]
    implied: bool = False

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """A tagged union of the models."""
        models = self.models()
        choices = {name: handler.generate_schema(model) for name, model in models.items()}
        union = core_schema.tagged_union_schema(choices, discriminator="kind")
        if not self.implied:
            return union
        first = next(iter(models))

        def with_kind(value: Any) -> Any:
            return {"kind": first, **value} if isinstance(value, dict) and "kind" not in value else value

        return core_schema.no_info_before_validator_function(with_kind, union)
