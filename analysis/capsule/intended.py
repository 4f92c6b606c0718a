"""What changed on purpose in reports: what `analysis verify` says of it in an older capsule.

Each has its line under "Numbers changed" in CHANGELOG.md: the command, the wrong number, how to notice it.
"""

import re
from dataclasses import dataclass
from datetime import date

CHANGED = date(2026, 11, 28)
"""The day of the changes of 0.2.0's last week."""


@dataclass(frozen=True)
class IntendedChange:
    """A part of a report that a release changed.

    Attributes
    ----------
    since : date
        The day of the change: capsules made later than that have the new numbers.
    part : str
        Regular expression of places in `results.json`, such as `pairwise[3].cell_a`, and of headings in
        `report.md`.
    why : str
        What is different now, without a full stop.
    """

    since: date
    part: str
    why: str


INTENDED = (
    IntendedChange(CHANGED, r"pairwise\[\d+\]\.cell_[ab]\b.*", "pairs name their cells as levels by factor"),
    IntendedChange(
        CHANGED,
        "Ordinal mixed model",
        "the ordinal model has slopes of every effect, interactions included, and accurate integrals; the p "
        "next to it is that of the F reported first",
    ),
    IntendedChange(
        CHANGED,
        "Linear mixed model",
        "covariates that vary within participants have slopes by participant; the p next to the model is "
        "that of the F reported first",
    ),
    IntendedChange(
        CHANGED,
        r"Multiverse of exclusions|In brief|In sentences|Method|simple_effects\b.*",
        "the F that is reported first is the same in every part of a report",
    ),
    IntendedChange(
        CHANGED,
        r"Evidence that answers are a person's|evidence\b.*",
        "the verdict 'likely' needs checks that were passed",
    ),
    IntendedChange(
        CHANGED,
        r"Who and what was left out|decisions\b.*",
        "copied rows and repeated ids are named as decisions",
    ),
)


def intended_change(spot: str, made: date) -> IntendedChange | None:
    """The change that explains a difference at this spot in a capsule made on this day; None elsewhere."""
    return next((one for one in INTENDED if made <= one.since and re.fullmatch(one.part, spot)), None)
