"""Two clips, at once or in turn, which of them: its [trial] and its answer."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from experiments.declaration.base import Declaration, Name, Translated
from experiments.declaration.trial import Answer, HasTrial, TrialDeclaration
from experiments.errors import InputError

# The keys of a [trial] whose kind is `paired_comparison`.


class SideBySide(Declaration):
    """Two clips next to each other on one canvas, driven by one clock.

    `if_too_narrow` decides what happens if the clips do not fit on the screen at actual size. Each answer
    stores which arrangement was shown.
    """

    arrangement: Literal["side_by_side"] = "side_by_side"
    """The name of this arrangement."""
    gap_mm: Annotated[float, Field(ge=0, le=100)] = 8.0
    """Blank background between the two clips, in mm."""
    if_too_narrow: Literal["stack", "refuse"]
    """If two clips do not fit next to each other: stack them, or ask for a larger window."""


class Stacked(Declaration):
    """Two clips one above the other on one canvas, driven by one clock."""

    arrangement: Literal["stacked"] = "stacked"
    """The name of this arrangement."""
    gap_mm: Annotated[float, Field(ge=0, le=100)] = 8.0
    """Blank background between the two clips, in mm."""


class OneAfterTheOther(Declaration):
    """Two clips in the same place, separated by `gap_ms` of blank background."""

    arrangement: Literal["one_after_the_other"] = "one_after_the_other"
    """The name of this arrangement."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)]
    """Blank background between the two clips, in ms."""


Presentation = Annotated[SideBySide | Stacked | OneAfterTheOther, Field(discriminator="arrangement")]


class AllPairs(Declaration):
    """All pairs of clips; `matched` compares only clips with the same exemplar number."""

    among: Literal["all"] = "all"
    """The name of this choice of pairs."""
    exemplars: Literal["matched", "any"] = "matched"
    """Only clips with the same exemplar number, or any two clips of the design."""


class WithinFactor(Declaration):
    """Clips that differ in one factor only: other factors and the exemplar are the same."""

    among: Literal["within"] = "within"
    """The name of this choice of pairs."""
    factor: Name
    """The factor in which the two clips differ."""


class CellPair(Declaration):
    """Two cells to compare, by label. Each exemplar is compared with the same exemplar of the other cell."""

    cell: str
    """Label of the first cell: its level names in factor order, separated by slashes."""
    other: str
    """Label of the other cell."""


class DeclaredPairs(Declaration):
    """Only the pairs of cells in this list."""

    among: Literal["declared"] = "declared"
    """The name of this choice of pairs."""
    cells: Annotated[tuple[CellPair, ...], Field(min_length=1)]
    """The pairs of cells."""


Pairs = Annotated[AllPairs | WithinFactor | DeclaredPairs, Field(discriminator="among")]


class InTurn(Declaration):
    """Every participant gets all pairs, or the next `pairs_per_person` of one random order for the study."""

    by: Literal["turn"] = "turn"
    """The name of this method."""


class IncompleteBlocks(Declaration):
    """Each participant sees a few of the clips and compares all pairs of them.

    The blocks form a balanced incomplete design. In a complete round, every pair is compared equally often,
    and every clip is in equally many blocks.
    """

    by: Literal["bibd"] = "bibd"
    """The name of this method."""
    clips_per_block: Annotated[int, Field(ge=2, le=100)]
    """Clips in a block; all pairs of them are compared. If no design has this size, the error names nearby
    sizes."""
    blocks_per_person: Annotated[int, Field(ge=1, le=1000)] = 1
    """Blocks per participant."""


class Active(Declaration):
    """When a participant starts, the server chooses the most informative pairs given all answers so far."""

    by: Literal["active"] = "active"
    """The name of this method."""
    random_share: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Share of a participant's pairs that is drawn at random, whatever the answers so far."""


Dealing = Annotated[InTurn | IncompleteBlocks | Active, Field(discriminator="by")]


class Ties(Declaration):
    """The answer that the participant chooses neither clip, and its label."""

    label: Translated
    """Label of this answer, in every language."""


class Reference(Declaration):
    """A clip shown before each pair, as in degradation category rating. It has the exemplar number of the
    pair."""

    cell: str
    """Label of the reference cell. The exemplar is that of the pair, and between-participant levels are the
    participant's own."""
    label: Translated
    """Text below the reference while it plays, in every language."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    """Blank background after the reference, in ms."""


class PairedComparison(TrialDeclaration):
    """A choice between two clips, shown at once or in turn, with a tie if one is declared.

    If the mouse has not moved since its last click, clicks are ignored until `pointer_delay_ms` have passed.
    """

    kind: Literal["paired_comparison"] = "paired_comparison"
    """The kind of this trial."""
    question: Translated
    """The question about the two clips, in every language."""
    presentation: Presentation
    """How the two clips are shown. There is no default."""
    pairs: Pairs
    """Which clips are compared."""
    dealing: Dealing = InTurn()
    """Which participant compares which pairs: in turn, balanced incomplete blocks, or the most informative
    pairs."""
    ties: Ties | None = None
    """Allows participants to choose neither clip."""
    reference: Reference | None = None
    """A clip shown before each pair."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time in ms for which clicks are ignored if the mouse has not moved since its last click."""
    pairs_per_person: Annotated[int, Field(ge=1, le=5000)] | None = None
    """Comparisons per participant in a block, taken in turn from all pairs. Leave empty for all pairs."""
    expected_seconds: Annotated[float, Field(gt=0)] = 8.0
    """Average duration of a trial, in seconds. The length of a visit is computed from it."""

    def asked(self, language: str) -> str:
        """The question and the possible answers."""
        tie = f" or tie ({self.ties.label.get(language, '')})" if self.ties else ""
        return f"Question: {self.question.get(language, '')} Answers: left, right{tie}."

    @model_validator(mode="after")
    def _dealing_fits(self) -> Self:
        each = self.pairs_per_person
        if self.dealing.by == "bibd" and each is not None:
            raise ValueError("pairs_per_person: the blocks determine the number of pairs; remove this key")
        if self.dealing.by == "bibd" and self.pairs.among == "declared":
            raise ValueError(
                "dealing: `bibd` needs pairs among `all` or `within` a factor, got a list of pairs"
            )
        if self.dealing.by == "active" and each is None:
            raise ValueError(
                "pairs_per_person is required with `active`: the number of pairs per participant"
            )
        return self

    @property
    def roles(self) -> tuple[str, str]:
        """The two clips' roles as shown: sides, or order."""
        if isinstance(self.presentation, OneAfterTheOther):
            return ("first", "second")
        return ("left", "right")

    @property
    def arrangements(self) -> tuple[str, ...]:
        """Every arrangement that this declaration can show."""
        shown = self.presentation
        if isinstance(shown, SideBySide) and shown.if_too_narrow == "stack":
            return ("side_by_side", "stacked")
        return (shown.arrangement,)

    @model_validator(mode="after")
    def _languages_agree(self) -> Self:
        labelled = {"ties": self.ties, "reference": self.reference}
        for path, labels in ((f"{name}.label", one.label) for name, one in labelled.items() if one):
            missing = sorted(set(self.question) - set(labels))
            if missing:
                raise ValueError(f"{path} has no text in '{missing[0]}', which the question has")
        return self

    def view_ms(self, lengths: Mapping[str, float]) -> float:
        """Both clips, at once or in turn; before them the reference, where there is one."""
        pair = {role: length for role, length in lengths.items() if role != "reference"}
        shown = self.presentation
        lasted = super().view_ms(pair)
        if isinstance(shown, OneAfterTheOther) and pair:
            lasted = sum(pair.values()) + shown.gap_ms
        if self.reference is not None and "reference" in lengths:
            lasted += lengths["reference"] + self.reference.gap_ms
        return lasted


def paired_comparison_of(experiment: HasTrial) -> PairedComparison:
    """The experiment's trial as a paired comparison; InputError where it is of another kind."""
    if not isinstance(experiment.trial, PairedComparison):
        raise InputError(
            f"expected trials of the kind paired_comparison, got {experiment.trial.kind} in "
            f"'{experiment.name}'"
        )
    return experiment.trial


# The answer to one pair.

CODES = {"left": 1, "right": 2, "tie": 3}
"""The number of each answer, as used by its key and by attention checks."""


class ComparisonAnswer(Answer):
    """The clip chosen, or a tie; None where the pair could not be shown.

    `left` is the first of two clips in turn, and the upper of two stacked ones.
    """

    kind: Literal["paired_comparison"]
    winner: Literal["left", "right", "tie"] | None
    arrangement: Literal["side_by_side", "stacked", "one_after_the_other"] | None = None
    """The arrangement shown. It can differ from the declared one if two clips did not fit side by side."""

    @property
    def given(self) -> bool:
        """True where a clip, or neither, was chosen."""
        return self.winner is not None


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer."""
    return CODES.get(payload["winner"])
