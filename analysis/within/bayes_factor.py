"""Bayes factors of t tests with Jeffreys, Zellner and Siow's prior."""

import numpy as np

PRIOR_SCALE = 2**0.5 / 2
"""Scale r of the Cauchy prior on effect sizes."""

_LOG_Z = np.arange(-45.0, 2.6, 0.02)
"""Where the integral is summed; the normal density is below 1e-40 beyond."""


def bayes_factor(t: float, n: float, df: float, scale: float = PRIOR_SCALE) -> float:
    r"""How much better a difference predicts t than none does.

    Parameters
    ----------
    t : float
        Of a test of one sample of differences, or of two groups.
    n : float
        Differences; of two groups n1 n2 / (n1 + n2).
    df : float
        Of t.
    scale : float
        r, of the Cauchy prior on the effect in standard deviations.

    Returns
    -------
    float
        BF10; NaN where t or n is.

    Notes
    -----
    Rouder et al. (2009), equation 1, doi:10.3758/PBR.16.2.225:

    .. math:: BF_{10} = \frac{\int_0^\infty (1 + n g r^2)^{-1/2}
        \left(1 + \frac{t^2}{\nu (1 + n g r^2)}\right)^{-(\nu + 1) / 2} p(g) \, dg}
        {(1 + t^2 / \nu)^{-(\nu + 1) / 2}}

    g is 1 over a chi-squared variate on one df, so that with :math:`g = z^{-2}` its density is that of a
    normal z, twice; summed over equal steps of log z, which converges exponentially. pingouin gives the same
    by scipy's `quad`; importing it takes as long as the rest of a report.
    """
    if not (np.isfinite(t) and np.isfinite(n)):
        return float("nan")
    z2 = np.exp(2 * _LOG_Z)
    # log(1 + n r^2 / z^2), and what t says of each g against what it says of no difference
    inflation = np.log1p(n * scale**2 / z2)
    odds = (df + 1) / 2 * (np.log1p(t**2 / df) - np.log1p(t**2 / df * np.exp(-inflation)))
    log_terms = odds - inflation / 2 - z2 / 2 + _LOG_Z + np.log(2 * 0.02 / np.sqrt(2 * np.pi))
    largest = float(log_terms.max())
    with np.errstate(over="ignore"):
        return float(np.exp(largest) * np.exp(log_terms - largest).sum())
