"""Two clips, at once or in turn, which of them: its [trial] and its answer."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from experiments.declaration.base import Declaration, Name, Translated
from experiments.declaration.trial import Answer, HasTrial, TrialDeclaration
from experiments.errors import InputError

# The keys of a [trial] whose kind is `paired_comparison`.


class SideBySide(Declaration):
    """Two clips beside one another on one canvas, drawn by one clock.

    `if_too_narrow` says what happens on a screen where the two do not fit at actual size: they are stacked,
    or the participant is asked for a larger window. Which of them was shown is stored with each answer.
    """

    arrangement: Literal["side_by_side"] = "side_by_side"
    """Names this arrangement."""
    gap_mm: Annotated[float, Field(ge=0, le=100)] = 8.0
    """Plain background between the two clips, in mm."""
    if_too_narrow: Literal["stack", "refuse"]
    """Where two clips do not fit beside one another: stack them, or ask for a larger window."""


class Stacked(Declaration):
    """Two clips one above the other on one canvas, drawn by one clock."""

    arrangement: Literal["stacked"] = "stacked"
    """Names this arrangement."""
    gap_mm: Annotated[float, Field(ge=0, le=100)] = 8.0
    """Plain background between the two clips, in mm."""


class OneAfterTheOther(Declaration):
    """Two clips in the same place, the second `gap_ms` of plain background after the first."""

    arrangement: Literal["one_after_the_other"] = "one_after_the_other"
    """Names this arrangement."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)]
    """Plain background between the two clips, in ms."""


Presentation = Annotated[SideBySide | Stacked | OneAfterTheOther, Field(discriminator="arrangement")]


class AllPairs(Declaration):
    """Every clip with every other; `matched` compares clips of the same exemplar number only."""

    among: Literal["all"] = "all"
    """Names this choice of pairs."""
    exemplars: Literal["matched", "any"] = "matched"
    """Only clips of the same exemplar number, or any two clips of the design."""


class WithinFactor(Declaration):
    """Clips that differ in the level of one factor only: other factors and the exemplar are the same."""

    among: Literal["within"] = "within"
    """Names this choice of pairs."""
    factor: Name
    """The factor in whose level the two clips differ."""


class CellPair(Declaration):
    """Two cells to compare, by their labels, each exemplar of the one with the same exemplar of the other."""

    cell: str
    """Label of the one cell: its level names in factor order, joined by slashes."""
    other: str
    """Label of the other cell."""


class DeclaredPairs(Declaration):
    """The pairs of cells in this list and no others."""

    among: Literal["declared"] = "declared"
    """Names this choice of pairs."""
    cells: Annotated[tuple[CellPair, ...], Field(min_length=1)]
    """The pairs of cells."""


Pairs = Annotated[AllPairs | WithinFactor | DeclaredPairs, Field(discriminator="among")]


class InTurn(Declaration):
    """Every participant gets all pairs, or the next `pairs_per_person` of one order drawn for the study."""

    by: Literal["turn"] = "turn"
    """Names this way of dealing."""


class IncompleteBlocks(Declaration):
    """Each participant sees a few of the clips and compares each of them with each other.

    The blocks are those of a balanced incomplete design: over a whole round of it every pair is compared
    equally often, and every clip is in as many blocks as any other.
    """

    by: Literal["bibd"] = "bibd"
    """Names this way of dealing."""
    clips_per_block: Annotated[int, Field(ge=2, le=100)]
    """Clips in a block; all pairs of them are compared. Where no design has them, near sizes are named."""
    blocks_per_person: Annotated[int, Field(ge=1, le=1000)] = 1
    """Blocks of one participant."""


class Active(Declaration):
    """The server chooses, when a participant begins, the pairs that tell most by what is answered so far."""

    by: Literal["active"] = "active"
    """Names this way of dealing."""
    random_share: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Share of a participant's pairs that is drawn by lot from the others, whatever they tell."""


Dealing = Annotated[InTurn | IncompleteBlocks | Active, Field(discriminator="by")]


class Ties(Declaration):
    """The answer that neither clip is chosen, and its label."""

    label: Translated
    """Label of this answer, in every language."""


class Reference(Declaration):
    """A clip shown before each pair, as in degradation category rating: the cell, the pair's exemplar."""

    cell: str
    """Label of its cell; the exemplar is that of the pair, and levels between participants are the
    participant's own."""
    label: Translated
    """What the page says below it while it runs, in every language."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    """Plain background after it, in ms."""


class PairedComparison(TrialDeclaration):
    """Which of two clips? Shown at once or in turn, with a tie where one is declared.

    A mouse that has not moved since its last press chooses nothing until `pointer_delay_ms` have passed.
    """

    kind: Literal["paired_comparison"] = "paired_comparison"
    """Names this kind of trial."""
    question: Translated
    """What is asked of the two clips, in every language."""
    presentation: Presentation
    """How the two clips are shown; there is no default."""
    pairs: Pairs
    """Which clips are compared."""
    dealing: Dealing = InTurn()
    """Who compares which of the pairs: in turn, in balanced incomplete blocks, or the most telling next."""
    ties: Ties | None = None
    """Allows the answer that neither is chosen."""
    reference: Reference | None = None
    """A clip shown before each pair."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time, in ms, for which a mouse that has not moved since its last press chooses nothing."""
    pairs_per_person: Annotated[int, Field(ge=1, le=5000)] | None = None
    """Comparisons of one participant in a block, dealt in turn from all pairs; where not given, all."""
    expected_seconds: Annotated[float, Field(gt=0)] = 8.0
    """Expected length of a trial in seconds, for the length of a visit."""

    def asked(self, language: str) -> str:
        """The question and what may be answered."""
        tie = f" or tie ({self.ties.label.get(language, '')})" if self.ties else ""
        return f"Question: {self.question.get(language, '')} Answers: left, right{tie}."

    @model_validator(mode="after")
    def _dealing_fits(self) -> Self:
        each = self.pairs_per_person
        if self.dealing.by == "bibd" and each is not None:
            raise ValueError("pairs_per_person: blocks say how many pairs there are; leave it out")
        if self.dealing.by == "bibd" and self.pairs.among == "declared":
            raise ValueError("dealing: blocks need pairs among all or within a factor, not a list")
        if self.dealing.by == "active" and each is None:
            raise ValueError("pairs_per_person: say how many pairs are chosen for each participant")
        return self

    @property
    def roles(self) -> tuple[str, str]:
        """The two clips' roles as shown: sides, or order."""
        if isinstance(self.presentation, OneAfterTheOther):
            return ("first", "second")
        return ("left", "right")

    @property
    def arrangements(self) -> tuple[str, ...]:
        """Every arrangement that may be shown by this declaration."""
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
            f"this needs trials of the kind paired_comparison, '{experiment.name}' has "
            f"{experiment.trial.kind}"
        )
    return experiment.trial


# What a participant answers to one pair.

CODES = {"left": 1, "right": 2, "tie": 3}
"""The number of each answer, as its key has it and an attention check asks for it."""


class ComparisonAnswer(Answer):
    """The clip chosen, or a tie; None where the pair could not be shown.

    `left` is the first of two clips in turn, and the upper of two stacked ones.
    """

    kind: Literal["paired_comparison"]
    winner: Literal["left", "right", "tie"] | None
    arrangement: Literal["side_by_side", "stacked", "one_after_the_other"] | None = None
    """How the two were in fact shown, not as declared where two clips beside one another did not fit."""

    @property
    def given(self) -> bool:
        """True where a clip, or neither, was chosen."""
        return self.winner is not None


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer."""
    return CODES.get(payload["winner"])
