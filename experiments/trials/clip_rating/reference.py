"""The reference of degradation category rating (ITU-T P.910): which clip comes before the rated one."""

from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, model_validator

from experiments import design
from experiments.base import Declaration, LevelName, Name, Translated
from experiments.design import ClipSpec
from experiments.errors import did_you_mean

if TYPE_CHECKING:
    from experiments.definition import Experiment
    from experiments.definition.factors import Factor


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

    def of(self, experiment: "Experiment", clip: ClipSpec) -> ClipSpec:
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

    def rates(self, experiment: "Experiment", clip: ClipSpec) -> bool:
        """Whether this clip is rated: all but the references, unless they are hidden among the others."""
        return self.rate_itself or self.of(experiment, clip) != clip

    def fault(self, experiment: "Experiment") -> str | None:
        """What here does not fit the design, as `path: what to do`; None where all is well."""
        return (
            self._fault_of_clip(experiment)
            or self._fault_of_difference(experiment)
            or (None if self.rate_itself else self._fault_of_rest(experiment))
        )

    def _fault_of_clip(self, experiment: "Experiment") -> str | None:
        if self.factor is None:
            cells = ["/".join(level for _, level in cell) for cell in design.cells(experiment)]
            if self.cell not in cells:
                return (
                    f"trial.reference.cell: the design has no cell '{self.cell}'"
                    f"{did_you_mean(str(self.cell), cells)}"
                )
            return None
        if self.factor not in experiment.factor_names:
            nearest = did_you_mean(self.factor, experiment.factor_names)
            return f"trial.reference.factor: no factor is called '{self.factor}'{nearest}"
        factor = experiment.factor(self.factor)
        names = [level.name for level in factor.levels]
        if self.level not in names:
            return (
                f"trial.reference.level: '{self.factor}' has no level '{self.level}'"
                f"{did_you_mean(str(self.level), names)}"
            )
        return self._fault_of_factor(factor)

    def _fault_of_factor(self, factor: "Factor") -> str | None:
        if factor.between or factor.dealt:
            return (
                f"trial.reference.factor: participants see some levels of '{factor.name}' only; name a "
                "factor of which everybody sees all"
            )
        return None

    def _differing(self, experiment: "Experiment") -> list[str]:
        """The factors in whose levels a reference can differ from its clip, in declared order."""
        return [
            factor.name
            for factor in experiment.factors
            if len(factor.levels) > 1
            and (factor.name == self.factor if self.cell is None else not factor.between)
        ]

    def _fault_of_difference(self, experiment: "Experiment") -> str | None:
        """A reference is another clip than some, and shows the blink of each."""
        differing = self._differing(experiment)
        if not differing:
            return (
                "trial.reference: every clip would be its own reference; name a factor of which each "
                "participant sees two levels or more"
            )
        own = next((name for name in differing if name in experiment.exemplars.own_per), None)
        if own is not None:
            return (
                f"exemplars.own_per: a reference shows the blink of its clip, but the levels of '{own}', in "
                f"which the two differ, have blinks of their own; leave '{own}' out of own_per"
            )
        return None

    def _fault_of_rest(self, experiment: "Experiment") -> str | None:
        """Without the reference's own trials the rated cells must still be a crossed design."""
        hidden = "or set rate_itself = true"
        split = experiment.blocks.split_by
        if self.factor is None and len(experiment.factors) > 1:
            return (
                f"trial.reference.cell: without ratings of '{self.cell}' the rated cells are not crossed; "
                f"name factor and level, {hidden}"
            )
        name = self.factor or experiment.factor_names[0]
        if split == name:
            return (
                f"blocks.split_by: the reference's level of '{name}' would be an empty block; "
                f"split by another factor, {hidden}"
            )
        if len(experiment.factor(name).levels) < 3:
            return (
                f"trial.reference: '{name}' needs two levels beside the reference's to compare; "
                f"add a level, {hidden}"
            )
        return None
