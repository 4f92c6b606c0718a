"""The reference of degradation category rating (ITU-T P.910): which clip comes before the rated one."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.base import Declaration, LevelName, Name, Translated
from experiments.trials.declared import ClipSpec, HasFactors


class RatingReference(Declaration):
    """The clip shown before each rated one, as in degradation category rating (ITU-T P.910).

    Either the rated clip with another `level` of one `factor`, or the clip of one `cell` with the exemplar of
    the rated clip.
    """

    factor: Name | None = None
    """The factor in whose level the reference differs from the rated clip; all other levels and the exemplar
    are those of the rated clip."""
    level: LevelName | None = None
    """The reference's level of that factor."""
    cell: str | None = None
    """Label of the reference's cell, instead of `factor` and `level`: its level names in factor order, joined
    by slashes. Levels between participants are the participant's own."""
    label: Translated
    """What the page says below the reference while it runs, in every language."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)] = 2000
    """Plain background between the reference and the rated clip, in ms."""
    rate_itself: bool = False
    """Whether the reference is also rated against itself (P.910's hidden reference); else its cells are not
    rated."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.factor is None) != (self.level is None):
            given, missing = ("level", "factor") if self.factor is None else ("factor", "level")
            raise ValueError(f"expected factor and level together, got {given} without {missing}")
        if (self.factor is None) == (self.cell is None):
            got = "neither" if self.cell is None else "both"
            raise ValueError(f"expected factor and level, or cell; got {got}")
        return self

    def of(self, experiment: HasFactors, clip: ClipSpec) -> ClipSpec:
        """The reference of this clip; a clip of the reference's cell is its own."""
        if self.factor is not None and self.level is not None:
            levels = tuple(
                (name, self.level if name == self.factor else level) for name, level in clip.levels
            )
            return ClipSpec(levels, clip.exemplar)
        named = dict(zip(experiment.factor_names, str(self.cell).split("/"), strict=True))
        named |= {factor.name: clip.level(factor.name) for factor in experiment.factors if factor.between}
        return ClipSpec(tuple(named.items()), clip.exemplar)

    def said(self) -> str:
        """The reference in one line of a plan."""
        named = (
            f"its own with {self.factor} {self.level}"
            if self.cell is None
            else f"that of the cell {self.cell}"
        )
        itself = "rated too, against itself" if self.rate_itself else "not rated itself"
        return f"before each clip its reference: {named}, {itself}; {self.gap_ms} ms between the two"

    def rates(self, experiment: HasFactors, clip: ClipSpec) -> bool:
        """Whether this clip is rated: all but the references, unless they are hidden among the others."""
        return self.rate_itself or self.of(experiment, clip) != clip
