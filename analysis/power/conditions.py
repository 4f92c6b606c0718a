"""Conditions of a planned study by how far each further one lies from the first."""

from collections.abc import Sequence

import numpy as np

from experiments.errors import InputError


def refuse_no_difference(differences: Sequence[float]) -> None:
    """Refuse a design without a further condition, and differences that are no numbers."""
    if not differences or not np.isfinite(differences).all():
        raise InputError(
            "expected how far each further condition lies from the first, such as 0.4 or 0.2,0.4"
        )


def said_of_differences(differences: Sequence[float]) -> str:
    """The conditions in words, without a unit."""
    if len(differences) == 1:
        return f"Two conditions differ by {differences[0]:g}"
    told = ", ".join(f"{difference:g}" for difference in differences[:-1])
    return (
        f"{len(differences) + 1} conditions, of which the further ones lie {told} and {differences[-1]:g} "
        "from the first, in"
    )
