"""Notes under a report's model call terms by labels, and no word of the note that is a factor's name too."""

import numpy as np
import pandas as pd

from analysis.models.formula import SLOPES_NOTE
from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from analysis.models.random_part import MixedResult
from analysis.plans.result import Labels
from analysis.plans.sensitivity import notes_of

LABELS = Labels({"fit": "Fit quality", "residual": "Left over"})


def ratings() -> pd.DataFrame:
    """Ratings of 6 people without any difference between these: two of each of four cells."""
    rows = pd.DataFrame(
        [
            (f"p{p}", fit, residual)
            for p in range(6)
            for fit in ("a", "b")
            for residual in ("c", "d")
            for _ in (1, 2)
        ],
        columns=["participant", "fit", "residual"],
    )
    noise = np.random.default_rng(0).permuted(np.tile(np.arange(8.0), (6, 1)), axis=1).ravel()
    return rows.assign(rating=np.floor(noise / 2) + 1)


def mixed() -> MixedResult:
    return fit_mixed(ratings(), "participant", "rating", ["fit", "residual"], None, "all")


def test_terms_have_labels_and_words_like_a_factor_have_none() -> None:
    sds, slopes, *zero, singular = notes_of(mixed(), LABELS)
    assert sds.startswith("Standard deviations: participant: intercept 0.000, Fit quality ")
    assert ", Left over " in sds
    assert ", Fit quality × Left over " in sds
    assert "; residual " in sds
    assert slopes == SLOPES_NOTE
    assert zero[0].startswith(
        "singular fit: the slope variance of participant Fit quality × Left over is estimated as zero, so "
        "that the test of Fit quality × Left over is against the residual (df = "
    )
    assert singular.startswith("singular fit: the variance of participant intercept ")
    assert singular.endswith("which does not affect the tests of other effects")


def test_terms_named_in_a_doubt_have_labels() -> None:
    result = fit_ordinal(ratings(), "participant", "rating", ["fit", "residual"], None, "main")
    said = " ".join(notes_of(result, LABELS))
    zero = [one.term for one in result.components if one.sd == 0 and one.term != "intercept"]
    assert zero
    assert [f"slopes of {LABELS.term(term)} is" in said for term in zero] == [True] * len(zero)


def test_a_factor_that_moves_between_people_has_its_label() -> None:
    rows = ratings()
    rows["residual"] = rows["participant"].isin(["p0", "p1", "p2"]).map({True: "c", False: "d"})
    result = fit_mixed(rows, "participant", "rating", ["fit", "residual"], None, "all")
    moved = "Left over: one level per participant, treated as a factor between participants"
    assert moved in notes_of(result, LABELS)


def test_without_labels_notes_are_as_the_model_says_them() -> None:
    assert notes_of(mixed(), Labels())[2:] == mixed().notes
