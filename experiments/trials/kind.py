"""What a kind of trial is made of. Everything else reads it from here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from experiments.assignment.compared import Compared
from experiments.assignment.trial import Trial
from experiments.base import Declaration
from experiments.columns.view import View
from experiments.design import BlockSpec, ClipSpec
from experiments.schema.effects import Effect
from experiments.trials.scales import RatedScale

if TYPE_CHECKING:
    from experiments.definition import Experiment


class TrialDeclaration(Declaration):
    """What every kind declares; each adds its own keys, and a constant as its `kind`."""

    kind: str
    """Kind of trial."""
    expected_seconds: Annotated[float, Field(gt=0)] = 6.0
    """Seconds a trial takes on average, from which the length of a visit is reckoned."""

    def asked(self, language: str) -> str:
        """What participants are asked and may answer, in one line of the codebook."""
        del language
        return ""

    def rated_scales(self) -> tuple[RatedScale, ...]:
        """The scales on which each trial is rated; none where its answers are no ratings."""
        return ()

    def rates(self, experiment: "Experiment", clip: ClipSpec) -> bool:
        """Whether trials ask about this clip; others of the design are only shown beside it."""
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

    def fault(self, experiment: "Experiment") -> str | None:
        """What here does not fit the rest of the experiment: `path: what to do`; None where all is well."""
        del experiment
        return None


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


def nothing_more(experiment: "Experiment") -> tuple[str, ...]:
    """What a plan says of a kind whose trials the cells and exemplars tell already."""
    del experiment
    return ()


def two_choices(experiment: "Experiment") -> int:
    """The answers that an attention check offers at least."""
    del experiment
    return 2


def never(experiment: "Experiment") -> bool:
    """No kind's trials depend on what is stored unless it says so."""
    del experiment
    return False


@dataclass(frozen=True)
class Kind:
    """A kind of trial.

    Attributes
    ----------
    declaration : type
        The model of the TOML's [trial]; the constant of its `kind` is the name.
    answer : type
        The model of what a participant answers to one trial, and how that is stored.
    view : View
        The rows it exports.
    roles : tuple of str
        The clips a trial shows, in the order of their places (`shown`; `left`, `right`).
    effects : mapping of str to {"wording", "measured"}
        What an edit of each key of the declaration does to stored answers, by path below [trial].
    page : type
        What of the declaration the participant's page is told.
    shown : callable
        Makes the page's model (`page`) from the declaration.
    assign : callable
        The trials of one participant in order, by declaration, seed and slot.
    block_size : callable
        Trials of one participant in a block, attention checks not counted.
    example : str
        A [trial] as TOML, for the reference; it is what a newcomer copies.
    further_examples : tuple of str
        Of keys that exclude one another, so that the reference shows each.
    shares_clips : bool
        Whether it follows [assignment]; else that is refused.
    groups : bool
        Whether it follows factors between participants; else they are refused.
    random_factors : bool
        Whether it follows random factors: deals their levels, and analyses them as random.
    plan : callable
        Lines that `stimuli plan` adds: expected counts; InputError where the design cannot be analysed.
    adapts : bool
        Whether answers decide what is shown next: the server then follows its series.
    chooses : callable
        Whether a run's trials are chosen by the comparisons stored before it.
    assign_by : callable or None
        As `assign`, with the comparisons stored before, where `chooses` says so.
    check_response : callable
        The number that an answer, as stored, is to an attention check, which asks for one.
    check_choices : callable
        How many numbers an attention check may ask for.
    """

    declaration: type[TrialDeclaration]
    answer: type[Answer]
    view: View
    roles: tuple[str, ...]
    effects: Mapping[str, Effect]
    page: type[Declaration]
    shown: "Callable[[Experiment], Declaration]"
    assign: "Callable[[Experiment, int, int], list[Trial]]"
    block_size: "Callable[[Experiment, BlockSpec], int]"
    example: str
    further_examples: tuple[str, ...] = ()
    plan: "Callable[[Experiment], tuple[str, ...]]" = nothing_more
    check_response: Callable[[Mapping[str, Any]], int | None] = lambda _: None
    check_choices: "Callable[[Experiment], int]" = two_choices
    shares_clips: bool = False
    groups: bool = False
    random_factors: bool = False
    adapts: bool = False
    chooses: "Callable[[Experiment], bool]" = never
    assign_by: "Callable[[Experiment, int, int, Sequence[Compared]], list[Trial]] | None" = None

    @property
    def name(self) -> str:
        """As the TOML, the database and the API name it."""
        return str(self.declaration.model_fields["kind"].default)
