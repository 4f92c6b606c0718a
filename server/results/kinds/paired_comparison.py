"""Paired comparisons: what was chosen in each pair of cells, and how often each level was."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

from sqlalchemy.orm import Session

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.declaration.paired_comparison import CODES
from server.models import Study, StudyVersion
from server.participation.tally_pools import PooledTally, pooled_tally
from server.results.repository import Pool, cells_of
from server.results.schemas import LevelChoices, PairChoices, PairResults
from server.results.service import common_results
from server.studies.lookup import definition_of

Outcomes = Counter[tuple[str, str, int]]
"""(cell on the left or first, cell on the right or second, number of the answer) -> how often."""


@dataclass(frozen=True)
class Choices:
    """Choices between two cells or levels, sides taken together."""

    n: int
    first: int
    second: int

    @property
    def ties(self) -> int:
        """Neither chosen."""
        return self.n - self.first - self.second


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> PairResults:
    """Choices of one pool, which is of the data series of `version`."""
    definition = definition_of(version)
    tally = pooled_tally(session, of.runs(), "", ())
    outcomes = outcomes_of(tally, cells_of(session, of))
    sides = Counter[int]()
    for (_, _, code), times in outcomes.items():
        sides[code] += times
    return PairResults(
        **common_results(study, version, of, tally),
        ratings=outcomes.total(),
        pairs=pair_choices(definition, outcomes),
        levels=level_choices(definition, outcomes),
        left=sides[CODES["left"]],
        right=sides[CODES["right"]],
        ties=sides[CODES["tie"]],
    )


def outcomes_of(tally: PooledTally, cells: Mapping[int, str]) -> Outcomes:
    """The answers by the cells of the two clips."""
    outcomes = Outcomes()
    for (left, right, code), times in tally.answers.items():
        if right is not None:
            outcomes[cells[left], cells[right], int(code)] += times
    return outcomes


def pair_choices(definition: Experiment, outcomes: Outcomes) -> list[PairChoices]:
    """Every pair of cells that was compared, in declared order."""
    order = ["/".join(level for _, level in cell) for cell in design.cells(definition)]
    between = _choices_between(outcomes)
    rows = []
    for first, second in combinations(order, 2):
        made = between.get((first, second))
        if made is not None:
            counts = {"n": made.n, "first_chosen": made.first, "second_chosen": made.second}
            rows.append(PairChoices(first=first, second=second, ties=made.ties, **counts))
    return rows


def _choices_between(outcomes: Mapping[tuple[str, str, int], int]) -> dict[tuple[str, str], Choices]:
    """Choices between two names, under both orders of the two."""
    counts: dict[tuple[str, str], list[int]] = defaultdict(lambda: [0, 0, 0])
    for (left, right, code), times in outcomes.items():
        for key, won, lost in (((left, right), "left", "right"), ((right, left), "right", "left")):
            counts[key][0] += times
            counts[key][1] += times if code == CODES[won] else 0
            counts[key][2] += times if code == CODES[lost] else 0
    return {key: Choices(*three) for key, three in counts.items()}


def level_choices(definition: Experiment, outcomes: Outcomes) -> list[LevelChoices]:
    """How often each level was chosen where it stood against another level of its factor, ties as half."""
    rows = []
    for index, factor in enumerate(definition.factors):
        by_level = Outcomes()
        for (left, right, code), times in outcomes.items():
            one, other = left.split("/")[index], right.split("/")[index]
            if one != other:
                by_level[one, other, code] += times
        for level in factor.levels:
            met = [made for (one, _), made in _choices_between(by_level).items() if one == level.name]
            n = sum(made.n for made in met)
            won = sum(made.first + made.ties / 2 for made in met)
            share = won / n if n else None
            rows.append(LevelChoices(factor=factor.name, level=level.name, n=n, share=share))
    return rows
