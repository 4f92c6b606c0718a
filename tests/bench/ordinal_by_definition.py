"""Which of two ordinal fits is nearer the maximum: Laplace's likelihood by its definition, in 80-bit floats.

    PYTHONPATH=. python tests/bench/ordinal_by_definition.py FOLDER NAME

FOLDER holds what `unseen_models.R` wrote; NAME is a model of it with one random intercept, such as Socatt.
Nothing of `analysis.models` but the design matrix is used. For clmm's fit and the one here: the
log-likelihood, its largest derivative, how far a Newton step moves any threshold (relative), and its gain.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.models.columns import ModelTerms
from analysis.models.design import model_data
from analysis.models.ordinal import fit_ordinal

Real = np.longdouble
GRADIENT_STEP, HESSIAN_STEP = Real("1e-4"), Real("1e-3")


def logistic(x):
    """The distribution function, without overflow."""
    small = np.exp(-np.abs(x))
    return np.where(x >= 0, 1 / (1 + small), small / (1 + small))


def log_likelihood(q, x, category, person, k):
    """Laplace's, of thresholds (k), coefficients and one SD; each person's mode by Newton's method."""
    beta, sd = q[k:-1], q[-1]
    edges = np.concatenate([[Real(-10000)], q[:k], [Real(10000)]])
    u = np.zeros(person.max() + 1, Real)
    for _ in range(100):
        eta = x @ beta + sd * u[person]
        a, b = edges[category + 1] - eta, edges[category] - eta
        upper, lower = logistic(a), logistic(b)
        score, curve = -u, np.ones_like(u)
        np.add.at(score, person, sd * (upper + lower - 1))
        np.add.at(curve, person, sd**2 * (upper * (1 - upper) + lower * (1 - lower)))
        if np.abs(score).max() < 1e-15:
            break
        u = u + np.clip(score / curve, -0.7, 0.7)
    ratings = np.log(upper) + np.log(logistic(-b)) + np.log1p(-np.exp(b - a))
    return ratings.sum() - (u @ u) / 2 - np.log(curve).sum() / 2


def derivatives(value, q):
    """Gradient (five points) and second derivatives (central differences)."""
    n = len(q)
    h, e = GRADIENT_STEP, np.eye(n).astype(Real)
    gradient = [
        (8 * (value(q + h * d) - value(q - h * d)) - value(q + 2 * h * d) + value(q - 2 * h * d)) / (12 * h)
        for d in e
    ]
    h = HESSIAN_STEP
    above, below, at = ([value(q + s * h * d) for d in e] for s in (1, -1, 0))
    second = np.zeros((n, n))
    for i in range(n):
        second[i, i] = float((above[i] + below[i] - 2 * at[i]) / h**2)
        for j in range(i):
            both = value(q + h * (e[i] + e[j])) + value(q - h * (e[i] + e[j])) + 2 * at[i]
            second[i, j] = second[j, i] = float(
                (both - above[i] - above[j] - below[i] - below[j]) / (2 * h**2)
            )
    return np.array(gradient, float), second


def main() -> None:
    """Print a line a fit."""
    folder, name = Path(sys.argv[1]), sys.argv[2]
    r = json.loads((folder / f"{name}.json").read_text())
    rows = pd.read_csv(folder / f"{name}.csv", dtype=str)
    rows[[r["y"], *r["covariate"]]] = rows[[r["y"], *r["covariate"]]].astype(float)
    terms = ModelTerms(r["id"], r["y"], tuple(r["within"]), (), tuple(r["between"]), tuple(r["covariate"]))
    here = fit_ordinal(rows, r["id"], r["y"], r["within"], between=r["between"], covariates=r["covariate"])
    x = model_data(rows, terms).x[:, 1:]
    category = np.unique(rows[r["y"]], return_inverse=True)[1]
    person = np.unique(rows[r["id"]], return_inverse=True)[1]
    k = len(here.thresholds)
    fits = {
        "here": [*here.thresholds, *(c.estimate for c in here.coefficients), here.sd_participant],
        "clmm": [*r["alpha"], *np.linalg.lstsq(x, np.array(r["eta"]), rcond=None)[0], r["sds"][0]],
    }
    for label, fit in fits.items():
        q = np.array(fit, Real)
        gradient, second = derivatives(lambda p: log_likelihood(p, x.astype(Real), category, person, k), q)
        step = np.linalg.solve(-second, gradient)
        moved = np.abs(step[:k] / q[:k].astype(float)).max()
        value = float(log_likelihood(q, x.astype(Real), category, person, k))
        sys.stdout.write(
            f"{label}: log-likelihood {value:.10f}, largest derivative {np.abs(gradient).max():.1e}, "
            f"a Newton step moves thresholds by {moved:.1e} and gains {step @ gradient / 2:.1e}\n"
        )


if __name__ == "__main__":
    main()
