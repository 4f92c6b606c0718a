"""The analysis, fixed before the data."""

from typing import Literal

from experiments.base import Declaration, Name


class AnalysisPlan(Declaration):
    """The analysis fixed before the data: factor order, the test of the table, and the pairs."""

    kind: Literal["within_anova"] = "within_anova"
    """Analysis of variance of participants' cell means, repeated over the factors within participants."""
    factors: tuple[Name, ...] = ()
    """Factors in the order of the tables; over those left out ratings are averaged. Empty takes all."""
    statistic: Literal["multivariate", "univariate"] = "multivariate"
    """Test that tables print: of the multivariate model (no sphericity needed), or univariate with
    Greenhouse-Geisser's correction. The JSON output holds both."""
    pairs: tuple[Name, ...] = ()
    """Factors whose levels the report compares pair by pair; empty takes every factor of the analysis.
    p values are given as they are, and corrected by Bonferroni and by Holm."""
    table: Literal["two_level_factors", "pairs_and_interactions", "one_factor"] = "two_level_factors"
    """Layout of the table: a row an effect, pairs beside interactions, or one factor."""
