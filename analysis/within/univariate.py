"""Univariate F tests, uncorrected and corrected for lack of sphericity."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.strata import Hypothesis

Floats = NDArray[np.float64]


class UnivariateTest(NamedTuple):
    """Univariate F with sphericity corrections; NaN where undefined (the effect's reason says why).

    `epsilon_hf` is uncapped; `p_hf` and the df of Huynh-Feldt use min(1, epsilon_hf).
    """

    ss: float
    ss_error: float
    df_effect: int
    df_error: int
    f_value: float
    p_value: float
    epsilon_gg: float
    p_gg: float
    epsilon_hf: float
    p_hf: float
    df_effect_gg: float
    df_error_gg: float
    df_effect_hf: float
    df_error_hf: float


def univariate_tests(hypotheses: Sequence[Hypothesis]) -> list[UnivariateTest]:
    r"""The univariate test of each hypothesis; p values of all are computed together.

    Notes
    -----
    .. math:: F = \frac{SS / (r q)}{SS_e / (q \nu)}
        \quad\text{on } \epsilon r q \text{ and } \epsilon q \nu \text{ df} \tag{1}

    q contrasts within people, r between them, nu the df of people within groups; epsilon is 1, Greenhouse and
    Geisser's, or Huynh and Feldt's (`huynh_feldt`), at most 1.
    """
    everything = [_f_and_df(h) for h in hypotheses]
    errors = [h.error for h in hypotheses]
    columns = np.array(everything, dtype=np.float64).T
    p_values = special.fdtrc(columns[1::2], columns[2::2], columns[0]).T.tolist()
    return [
        UnivariateTest(h.ss, e.ss, df1, df2, f, p, e.epsilon_gg, p_gg, e.epsilon_hf, p_hf, *corrected)
        for h, e, (f, df1, df2, *corrected), (p, p_gg, p_hf) in zip(
            hypotheses, errors, everything, p_values, strict=True
        )
    ]


def _f_and_df(hypothesis: Hypothesis) -> tuple[float, int, int, float, float, float, float]:
    """F and its df of effect and error: uncorrected, Greenhouse-Geisser's, Huynh-Feldt's."""
    error = hypothesis.error
    df1, df2 = hypothesis.rank * error.q, error.q * error.df
    f_value = (hypothesis.ss / df1) / (error.ss / df2) if error.ss else math.nan
    gg, hf = error.epsilon_gg, 1.0 if math.isnan(error.epsilon_hf) else min(1.0, error.epsilon_hf)
    return f_value, df1, df2, gg * df1, gg * df2, hf * df1, hf * df2
