"""Error bars of conditions that the same participants rated, for the page of results and the figures."""

import math
from collections.abc import Sequence
from statistics import stdev


def within_participant_errors(rows: Sequence[Sequence[float]]) -> list[float]:
    r"""Standard error of each condition without the differences between participants.

    Parameters
    ----------
    rows : sequence of shape (N, k)
        Mean rating of each of N participants in each of k conditions.

    Returns
    -------
    list of float
        k standard errors in the unit of the ratings; empty where N < 2.

    Notes
    -----
    Cousineau (2005), with the correction of Morey (2008). With the participant's mean taken out,

    .. math:: z_{ij} = y_{ij} - \bar y_{i\cdot} + \bar y_{\cdot\cdot}

    the standard error of condition j is

    .. math:: \mathrm{SE}_j = \sqrt{\frac{k}{k - 1}} \, \frac{\mathrm{sd}(z_{\cdot j})}{\sqrt N}

    and with k = 1 that of y itself. Sources: doi:10.20982/tqmp.01.1.p042, doi:10.20982/tqmp.04.2.p061.

    Examples
    --------
    >>> [round(error, 3) for error in within_participant_errors([[1, 3], [2, 5], [4, 6]])]
    [0.236, 0.236]
    """
    if len(rows) < 2:
        return []
    conditions = len(rows[0])
    if conditions == 1:
        return [stdev(row[0] for row in rows) / math.sqrt(len(rows))]
    columns, number = list(zip(*rows, strict=True)), len(rows)
    means = [sum(row) / conditions for row in rows]
    # The grand mean adds the same to every z of a condition, and so nothing to its deviation.
    return [
        math.sqrt(conditions / (conditions - 1) * _squares(column, means) / (number - 1) / number)
        for column in columns
    ]


def _squares(column: Sequence[float], means: Sequence[float]) -> float:
    """Sum of squared deviations of the z of one condition from their mean."""
    z = [value - mean for value, mean in zip(column, means, strict=True)]
    centre = math.fsum(z) / len(z)
    return math.fsum([(value - centre) ** 2 for value in z])
