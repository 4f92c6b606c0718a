"""How far from spherical the errors of within contrasts are: epsilon and Mauchly's test."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mauchly:
    """Mauchly's test of sphericity, chi-square with Box's second-order term (the textbook form)."""

    w: float
    p_value: float


def greenhouse_geisser(eigenvalues: Floats) -> float:
    r"""Greenhouse and Geisser's :math:`\hat\epsilon = (\mathrm{tr} E)^2 / (q \, \mathrm{tr} E^2)`.

    Parameters
    ----------
    eigenvalues : (q,) array
        Those of E, sums of squares and products of the residuals of q orthonormal contrasts.
    """
    return min(1.0, float(eigenvalues.sum()) ** 2 / (len(eigenvalues) * float(eigenvalues @ eigenvalues)))


def huynh_feldt(epsilon: float, contrasts: int, df_error: int) -> float:
    r"""Huynh and Feldt's epsilon, uncapped, with Lecoutre's (1991) correction for groups.

    Notes
    -----
    .. math:: \tilde\epsilon = \frac{(\nu + 1) q \hat\epsilon - 2}{q (\nu - q \hat\epsilon)} \tag{1}

    q contrasts, :math:`\nu` error df of participants, :math:`\hat\epsilon` Greenhouse and Geisser's. With
    :math:`q \hat\epsilon = \nu` (few participants) there is no finite value: NaN.
    """
    q, nu = contrasts, df_error
    room = nu - q * epsilon
    return ((nu + 1) * q * epsilon - 2) / (q * room) if room > 1e-9 * nu else math.nan


def mauchly_test(log_w: float, contrasts: int, df_error: int) -> Mauchly:
    """Mauchly's test of log W of q contrasts on the error df of participants."""
    q, nu = contrasts, df_error
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * nu)
    chi2, df = -nu * rho * log_w, q * (q + 1) / 2 - 1
    # R's mauchly.test has 3k for 3q here (k cells); this is the textbook's form, so p differs by up to .003
    omega = (q + 2) * (q - 1) * (q - 2) * (2 * q**3 + 6 * q**2 + 3 * q + 2) / (288 * (nu * q * rho) ** 2)
    first, second = float(special.chdtrc(df, chi2)), float(special.chdtrc(df + 4, chi2))
    return Mauchly(math.exp(log_w), min(max(first + omega * (second - first), 0.0), 1.0))
