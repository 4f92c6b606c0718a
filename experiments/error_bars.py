"""Error bars of conditions that the same participants rated, for the page of results and the figures."""

import math
from collections.abc import Sequence
from statistics import fmean, stdev


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
    grand = fmean(value for row in rows for value in row)
    centred = [[value - fmean(row) + grand for value in row] for row in rows]
    factor = math.sqrt(conditions / (conditions - 1) / len(rows))
    return [factor * stdev(row[place] for row in centred) for place in range(conditions)]
