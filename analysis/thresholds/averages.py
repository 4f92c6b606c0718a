"""Mean over people of estimates with known errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Average:
    """Mean of estimates with known errors over people; see `average`."""

    people: int
    mean: float
    se: float
    ci_low: float
    ci_high: float
    tau: float


def average(y: Array, errors: Array) -> Average | None:
    r"""Average estimates y (n,) over people, each weighted by 1 / (se^2 + tau^2); None below two people.

    tau^2 maximises the restricted likelihood of

    .. math::

        y_i &\sim N(\mu, s_i^2 + \tau^2), \quad w_i = 1 / (s_i^2 + \tau^2) \tag{1} \\
        -\log L_R &= \tfrac{1}{2} \{\log \textstyle\sum_i w_i - \sum_i \log w_i
            + \sum_i w_i (y_i - \hat\mu)^2\} \tag{2} \\
        \mathrm{se}^2 &= \textstyle\sum_i w_i (y_i - \hat\mu)^2 / \{(k - 1) \sum_i w_i\} \tag{3}

    with y_i a person's estimate, s_i its standard error, mu the weighted mean and k the people; (3), with
    t on k - 1 df, is Hartung and Knapp's (2001).
    """
    if len(y) < 2:
        return None
    s2 = errors**2

    def restricted(log_tau2: float) -> float:
        weights = 1 / (s2 + np.exp(log_tau2))
        mu = np.sum(weights * y) / weights.sum()
        return float(
            0.5 * (np.log(weights.sum()) - np.sum(np.log(weights)) + np.sum(weights * (y - mu) ** 2))
        )

    span = float(np.var(y)) + float(s2.mean())
    optimum = optimize.minimize_scalar(
        restricted, bounds=(np.log(span) - 25, np.log(span) + 3), method="bounded"
    )
    tau2 = float(np.exp(optimum.x)) if optimum.fun < restricted(-np.inf) else 0.0
    weights = 1 / (s2 + tau2)
    mean = float(np.sum(weights * y) / weights.sum())
    count = len(y)
    se = float(np.sqrt(np.sum(weights * (y - mean) ** 2) / ((count - 1) * weights.sum())))
    half = float(stats.t.ppf(0.975, count - 1)) * se
    return Average(count, mean, se, mean - half, mean + half, float(np.sqrt(tau2)))
