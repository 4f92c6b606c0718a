"""The linear mixed model of a report where factors are random: which tests hold for others of them."""

from typing import TYPE_CHECKING, Any

from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.models.mixed_result import MixedResult
    from analysis.models.roles import RandomSlopes

MAX_SLOPES = 500
"""With more coefficients of levels than this the model would keep the report waiting."""


def fit_with_random(
    arguments: dict[str, Any], random: list[str], every: bool
) -> "tuple[MixedResult, RandomSlopes]":
    """The fit whose effects may differ between the levels of random factors, as many as the data allow.

    The test of an effect holds for other levels only where it may differ between those shown. Slopes have a
    variance an effect, as those of participants: nested intercepts (`1 | face:A:B`) would share one variance
    among all contrasts, and too little of it with an interaction that alone differs between levels.

    Parameters
    ----------
    arguments : dict of str to Any
        Those of `fit_mixed` that are the same for every model.
    random : list of str
        The random factors; none for a model without.
    every : bool
        Whether participants have slopes of every effect; else of main effects.
    """
    import numpy as np

    from analysis.models.mixed import fit_mixed

    for slopes in _tried(arguments, random, every):
        chosen = _without_items_of_slopes(arguments, random) if slopes == "all" else arguments
        try:
            fitted = fit_mixed(
                **chosen, random=random, slopes="all" if every else "main", random_slopes=slopes
            )
        except (InputError, np.linalg.LinAlgError):
            continue
        return fitted, slopes
    return fit_mixed(**arguments, random=random, slopes="all" if every else "main"), "none"


def _tried(arguments: dict[str, Any], random: list[str], every: bool) -> "tuple[RandomSlopes, ...]":
    if not random:
        return ()
    rows, factors = arguments["rows"], [*arguments["within"], *arguments["between"]]
    levels = sum(rows[name].nunique() for name in random)
    small = levels * len(rows[factors].drop_duplicates()) <= MAX_SLOPES
    return ("all", "main") if every and small else ("main",)


def _without_items_of_slopes(arguments: dict[str, Any], random: list[str]) -> dict[str, Any]:
    """The same without items where each is a cell of a random factor: its slopes hold what they would."""
    rows, items = arguments["rows"], list(arguments["item"])
    own = [name for name in random if name in items]
    if len(own) != 1:
        return arguments
    cells = [*own, *arguments["within"], *arguments["between"]]
    one_each = len(rows[cells].drop_duplicates()) == len(rows[[*cells, *items]].drop_duplicates())
    return arguments | {"item": None} if one_each else arguments


def holds_for(effect: str, random: list[str], slopes: "RandomSlopes") -> str:
    """For which levels of the random factors a test holds."""
    tested = slopes == "all" or (slopes == "main" and ":" not in effect)
    names = " and ".join(random)
    return f"others of {names}" if tested else f"the {names} shown"


def said_of_random(random: list[str], slopes: "RandomSlopes") -> str:
    """What the report says of the random factors."""
    names = ", ".join(random)
    if slopes == "none":
        return (
            f"{names}: random, with an intercept for each level only, since effects that differ "
            "between levels could not be fitted: the tests hold for those shown."
        )
    which = "every effect" if slopes == "all" else "each main effect"
    text = (
        f"{names}: random, with an intercept and slopes for {which} at each level, so that tests of these "
        "hold for others like those shown; with few of them they have few df."
    )
    if slopes == "main":
        text += " Slopes for interactions were too many to fit: tests of interactions hold for those shown."
    return text
