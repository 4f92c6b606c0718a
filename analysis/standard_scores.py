"""Scores and screening by the standards of ITU: hidden references, comparisons, z-scores, unlike raters."""

from dataclasses import dataclass
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

Array = NDArray[np.float64]
Codes = NDArray[np.int64]
ScoreMethod = Literal["acr", "acr-hr", "ccr", "dscqs"]
P913_BELOW = 0.75
"""P.913: a lower correlation with the mean votes excludes."""
RATERS_MIN = 3
"""Fewer raters cannot be distinguished by their likeness to the mean."""
FAR_SHARE, LEAN_MAX = 0.05, 0.3
"""BT.500: more than this share of votes is far, and the sides differ by less than this share of them."""


@dataclass(frozen=True)
class Standard:
    """How votes become scores.

    Attributes
    ----------
    method : {"acr", "acr-hr", "ccr", "dscqs"}
        Absolute votes; against a hidden reference; comparisons with a reference; votes on test and reference.
    reference : str or None
        acr-hr: column that names the item's hidden reference. dscqs: column of the vote on the reference.
    first : str or None
        ccr: column that names what was shown first.
    highest : float or None
        acr-hr: highest point of the scale.
    crush : bool
        acr-hr: whether scores above the highest point are pulled toward it.
    z_scores : bool
        Whether each person's votes are standardized, in each session if `session` names its column.
    """

    method: ScoreMethod = "acr"
    reference: str | None = None
    first: str | None = None
    highest: float | None = None
    crush: bool = False
    z_scores: bool = False
    session: str | None = None

    def check(self) -> None:
        """Refuse options that do not belong together; InputError says what to add or remove."""
        needs = {"acr-hr": ("--reference", self.reference), "dscqs": ("--reference", self.reference)}
        needs["ccr"] = ("--first", self.first)
        name, given = needs.get(self.method, ("", "none"))
        if given is None:
            raise InputError(f"--method {self.method} needs {name} COLUMN")
        if self.first is not None and self.method != "ccr":
            raise InputError("--first is for --method ccr; remove it, or add --method ccr")
        if self.reference is not None and self.method not in ("acr-hr", "dscqs"):
            raise InputError("--reference is for --method acr-hr or dscqs; add one of them")
        if self.method == "acr-hr" and self.highest is None:
            raise InputError("--method acr-hr needs the ends of the scale: add, for example, --scale 1:5")
        if self.crush and (self.method != "acr-hr" or self.highest != 5):
            raise InputError("--crush is for --method acr-hr on a scale that ends at 5")
        if self.session is not None and not self.z_scores:
            raise InputError("--session is for --z-scores; add it, or remove --session")
        if self.z_scores and self.method != "acr":
            raise InputError(f"--z-scores is for --method acr, got {self.method}; remove one of them")


def differential_scores(scores: Array, references: Codes, highest: float, crush: bool) -> Array:
    r"""Scores (people, items) against each person's vote on the hidden reference, as in ITU-T P.910 ACR-HR.

    .. math::

        DV = V(\text{item}) - V(\text{reference}) + h \tag{1}

        DV' = 7 \, DV / (2 + DV) \text{ if } DV > 5 \tag{2}

    h is the highest point of the scale; (2) is the standard's crushing of scores above it, for h = 5.

    Parameters
    ----------
    scores : (people, items) array
        NaN where there is no vote.
    references : (items,) int64
        Index of each item's reference; -1 for references themselves, whose scores are NaN.
    """
    of_reference = np.where(references >= 0, scores[:, np.maximum(references, 0)], np.nan)
    differences = scores - of_reference + highest
    if crush:
        differences = np.where(differences > highest, 7 * differences / (2 + differences), differences)
    return np.asarray(differences, dtype=np.float64)


def standardized_votes(values: Array, group: Codes) -> Array:
    """Votes (n,) minus the mean of their group, over its SD (n - 1); NaN where a group does not vary."""
    n = np.bincount(group)
    mean = np.bincount(group, values) / n
    spread = np.bincount(group, (values - mean[group]) ** 2) / np.maximum(n - 1, 1)
    sd = np.where(spread > 0, np.sqrt(spread), np.nan)
    return np.asarray((values - mean[group]) / sd[group], dtype=np.float64)


# Raters whose votes are unlike the others'.


class Screening(TypedDict):
    """A rule, and for P.913 the correlation below which a rater goes."""

    rule: Literal["bt500", "p913"]
    below: float


def screen_raters(scores: Array, screening: Screening) -> dict[int, str]:
    """Return the raters (by row of `scores`, people by items, NaN for no vote) to leave out, with the reason.

    BT.500 is applied once, as it demands. P.913 leaves out the rater of the lowest correlation, computes the
    means again, and goes on until no correlation is too low.
    """
    if len(scores) < RATERS_MIN:
        return {}
    if screening["rule"] == "bt500":
        above, below, rejected = bt500_counts(scores)
        n = np.isfinite(scores).sum(axis=1)
        return {
            int(k): f"{above[k]} of {n[k]} ratings far above and {below[k]} far below the means"
            for k in np.flatnonzero(rejected)
        }
    return _by_correlation(scores, screening["below"])


def _by_correlation(scores: Array, limit: float) -> dict[int, str]:
    reasons: dict[int, str] = {}
    kept = np.ones(len(scores), dtype=bool)
    while kept.sum() >= RATERS_MIN:
        r = np.full(len(scores), np.inf)
        r[kept] = mean_correlations(scores[kept])
        lowest = int(np.argmin(r))
        if not r[lowest] < limit:
            break
        reasons[lowest] = f"correlation {r[lowest]:.2f} with the mean ratings, below {limit:g}"
        kept[lowest] = False
    return reasons


def mean_correlations(scores: Array) -> Array:
    """Correlation of each person's votes (people, items) with the mean of everybody's, on the items rated.

    A person whose votes do not vary has 0, as they say nothing; of fewer than three items it is infinite,
    since such a person cannot be judged.
    """
    seen = np.isfinite(scores)
    # not every item needs a vote of those who remain
    means = np.divide(
        np.nansum(scores, axis=0), seen.sum(axis=0), out=np.zeros(scores.shape[1]), where=seen.any(axis=0)
    )
    correlations = np.full(len(scores), np.inf)
    for k, (own, there) in enumerate(zip(scores, seen, strict=True)):
        if there.sum() > 2 and np.ptp(means[there]) > 0:
            varied = np.ptp(own[there]) > 0
            correlations[k] = np.corrcoef(own[there], means[there])[0, 1] if varied else 0.0
    return correlations


def bt500_counts(scores: Array) -> tuple[Codes, Codes, NDArray[np.bool_]]:
    """Votes of each person far above and far below, and whether ITU-R BT.500 rejects the person (people,).

    A vote is far beyond 2 SD of the item's votes where their kurtosis is between 2 and 4, beyond sqrt(20) SD
    elsewhere; a person goes where more than 5% of the votes are far and the sides differ by less than 30%.
    Items of one vote, or of which all votes are alike, have no vote that is far.
    """
    seen = np.isfinite(scores)
    n = seen.sum(axis=0)
    means = np.divide(np.nansum(scores, axis=0), n, out=np.zeros(scores.shape[1]), where=n > 0)
    centred = scores - means
    squares = np.nansum(centred**2, axis=0)
    varied = squares > 0
    sd = np.sqrt(squares / np.maximum(n - 1, 1))
    fourth = np.nansum(centred**4, axis=0)
    kurtosis = np.divide(fourth * n, squares**2, out=np.zeros_like(squares), where=varied)
    limit = np.where((kurtosis >= 2) & (kurtosis <= 4), 2.0, np.sqrt(20.0)) * sd
    above = np.sum((centred >= limit) & varied, axis=1)
    below = np.sum((centred <= -limit) & varied, axis=1)
    share = (above + below) / np.maximum(seen.sum(axis=1), 1)
    lean = np.abs(above - below) / np.maximum(above + below, 1)
    return above, below, np.asarray((share > FAR_SHARE) & (lean < LEAN_MAX))
