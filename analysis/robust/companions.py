"""The robust companions of one ANOVA, together."""

from dataclasses import dataclass

from analysis.robust.permutation import PermutationTest, permutation_tests
from analysis.robust.ranks import RankTest, rank_tests
from analysis.robust.trimmed import TrimmedPair, trimmed_pairs
from analysis.within.anova import AnovaResult
from experiments.errors import InputError


@dataclass(frozen=True)
class Companions:
    """Tests beside those of the ANOVA; `ranks` is empty where `ranks_reason` says why."""

    permutations: tuple[PermutationTest, ...]
    ranks: tuple[RankTest, ...]
    ranks_reason: str | None
    trimmed: tuple[TrimmedPair, ...]


def companions_of(result: AnovaResult) -> Companions:
    """Compute every robust companion of `result`."""
    try:
        ranks, reason = rank_tests(result), None
    except InputError as error:
        ranks, reason = (), str(error)
    return Companions(permutation_tests(result), ranks, reason, trimmed_pairs(result))
