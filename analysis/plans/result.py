"""One analysis, complete: what tables, figures and report are made from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING

from analysis.within.anova import AnovaResult
from analysis.within.cell_means import CellTable, name_cells
from analysis.within.contrast_tests import Contrast, Equivalence, contrasts_of, equivalence, trends
from analysis.within.estimates import MarginalMean, marginal_means
from analysis.within.pairwise import Pair, one_factor_pairs, pairs_of, quote_level
from analysis.within.simple_effects import SimpleEffect, reports_multivariate, simple_effects

if TYPE_CHECKING:
    from analysis.plans.exclusions import Exclusions
    from analysis.robust import Companions
    from analysis.within.bayes import BayesAnova
    from experiments.declaration.experiment import Experiment


TIMES = " × "


@dataclass(frozen=True)
class Labels:
    """What tables call factors and levels; without a label the name itself is used."""

    factors: Mapping[str, str] = field(default_factory=dict)
    levels: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def factor(self, name: str) -> str:
        """Label of a factor."""
        return self.factors.get(name, name)

    def level(self, factor: str, name: str) -> str:
        """Label of a factor's level."""
        return self.levels.get((factor, name), name)

    def effect(self, factors: Sequence[str]) -> str:
        """Label of an effect of several factors, or of one."""
        return TIMES.join(map(self.factor, factors))

    def term(self, name: str) -> str:
        """Label of a model's term, where ':' joins factors; one that holds anything else is left alone."""
        factors, space, contrast = name.partition(" ")
        parts = factors.split(":")
        return self.effect(parts) + space + contrast if self.factors.keys() >= set(parts) else name

    def cell(self, levels: Mapping[str, str]) -> str:
        """Labels of the levels by their factors, which are named where a label holds a comma."""
        labels = {factor: self.level(factor, name) for factor, name in levels.items()}
        if len(labels) > 1 and any("," in label for label in labels.values()):
            return ", ".join(
                f"{self.factor(factor)}={quote_level(label)}" for factor, label in labels.items()
            )
        return ", ".join(labels.values())

    def pair(self, cell_a: Mapping[str, str], cell_b: Mapping[str, str]) -> str:
        """Two cells of a margin, each factor's level by name."""
        texts = [self.cell(cell_a), self.cell(cell_b)]
        if any(" - " in text for text in texts):
            texts = [f'"{text}"' for text in texts]
        return f"{self.effect(tuple(cell_a))}: {' - '.join(texts)}"


def labels_of(experiment: "Experiment") -> Labels:
    """The labels an experiment declares."""
    return Labels(
        factors={f.name: f.label for f in experiment.factors},
        levels={(f.name, level.name): level.label for f in experiment.factors for level in f.levels},
    )


@dataclass(frozen=True)
class Analysis:
    """Cell means, tests, means and pairs of one data set, with every decision taken on the way.

    `experiment` and `exclusions` are None for a table of which no declaration is known.
    """

    name: str
    title: str
    source: str
    rating: str
    synthetic: bool
    cells: CellTable
    anova: AnovaResult
    means: tuple[MarginalMean, ...]
    pairs: tuple[Pair, ...]
    decisions: tuple[str, ...]
    labels: Labels = Labels()
    simple_effects: tuple[SimpleEffect, ...] = ()
    trends: tuple[Contrast, ...] = ()
    contrasts: tuple[Contrast, ...] = ()
    equivalence: tuple[Equivalence, ...] = ()
    experiment: "Experiment | None" = None
    exclusions: "Exclusions | None" = None
    robust: "Companions | None" = None
    bayes: "BayesAnova | None" = None
    univariate: bool = False

    @property
    def multivariate_first(self) -> bool:
        """Whether the F reported first is the multivariate one: `reports_multivariate`."""
        return reports_multivariate(self.anova, not self.univariate)

    @property
    def n_participants(self) -> int:
        """Participants in the tests."""
        return self.anova.n_participants

    def pairs_within(self, effect: str) -> list[Pair]:
        """The pairs of one margin."""
        return [pair for pair in self.pairs if pair.effect == effect]


def analysis_of(
    cells: CellTable,
    anova: AnovaResult,
    *,
    name: str,
    title: str,
    source: str,
    rating: str,
    synthetic: bool = False,
    two_factor_pairs: bool = False,
    equivalence_bounds: tuple[float, float] | None = None,
    planned_contrasts: Sequence[tuple[str, Sequence[float]]] = (),
    decisions: tuple[str, ...] = (),
    labels: Labels | None = None,
    experiment: "Experiment | None" = None,
    exclusions: "Exclusions | None" = None,
    univariate: bool = False,
) -> Analysis:
    """What follows from the ANOVA of a table of cell means: means, pairs, simple effects, contrasts.

    A study that plans univariate tests gets these first, too.
    """
    univariate = univariate or not plans_multivariate(experiment)
    pairs = one_factor_pairs(anova)
    if two_factor_pairs:
        doubles = combinations(anova.all_factors, 2)
        pairs += tuple(pair for factors in doubles for pair in pairs_of(anova, factors))
    return Analysis(
        name=name,
        title=title,
        source=source,
        rating=rating,
        synthetic=synthetic,
        cells=cells,
        anova=anova,
        means=marginal_means(anova),
        pairs=pairs,
        decisions=(*decisions, *cell_decisions(cells), *group_decisions(anova)),
        labels=labels or Labels(),
        simple_effects=simple_effects(anova, planned=not univariate),
        trends=trends(anova),
        contrasts=tuple(
            contrast
            for factor, weights in planned_contrasts
            for contrast in contrasts_of(anova, factor, [(" ".join(f"{w:g}" for w in weights), weights)])
        ),
        equivalence=equivalence(pairs, *equivalence_bounds) if equivalence_bounds else (),
        experiment=experiment,
        exclusions=exclusions,
        univariate=univariate,
    )


def plans_multivariate(experiment: "Experiment | None") -> bool:
    """Whether a study plans multivariate tests; tables without a declaration do."""
    return experiment is None or experiment.analysis.statistic == "multivariate"


def cell_decisions(cells: CellTable) -> tuple[str, ...]:
    """What the table of cell means did: who was dropped for empty cells, uneven counts, constant ratings."""
    said = [
        f"participant {d.participant} excluded: no rating in {name_cells(d.missing_cells)}"
        for d in cells.dropped
    ]
    low, high = int(cells.counts.min()), int(cells.counts.max())
    if low != high:
        said.append(f"cells have {low} to {high} ratings; all cell means have equal weight")
    said += [
        f"participant {participant} gave the same rating throughout; kept" for participant in cells.constant
    ]
    return tuple(said)


def group_decisions(anova: AnovaResult) -> tuple[str, ...]:
    """What was done about groups and covariates: sizes of uneven groups, the type of tests, centering."""
    said, design = [], anova.between
    sizes = design.group_sizes() if design.factors else {}
    if len(set(sizes.values())) > 1:
        named = ", ".join(f"{' '.join(levels)} {size}" for levels, size in sizes.items())
        kind = "III (equal weight for every group mean)" if anova.sum_of_squares == 3 else "II"
        said.append(f"groups differ in size ({named}); sums of squares are type {kind}")
    for levels, size in sizes.items():
        if size == 1:
            said.append(
                f"group {' '.join(levels)} has one participant: its variance is unknown, so its tests and "
                "errors use the variance of the other groups"
            )
    for covariate in design.covariates:
        if covariate.centred:
            said.append(
                f"covariate '{covariate.name}' was centered at its mean {covariate.centre:.4g}: other "
                "effects and means are evaluated at this value"
            )
        else:
            said.append(
                f"covariate '{covariate.name}' was not centered: effects within participants are evaluated "
                "at 0"
            )
    return tuple(said)
