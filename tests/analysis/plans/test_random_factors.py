"""Faces as random items in the analysis of a study, on simulated ratings whose truth is known."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.models.mixed import fit_mixed
from analysis.plans.clip_rating import READING, analyse_study
from analysis.plans.result import Analysis
from analysis.plans.sensitivity import fit_with_random, holds_for, mixed_model, ordinal_model, said_of_random
from analysis.read.study_answers import load_csv
from experiments.kinds.clip_rating import CLIP_RATING
from tests.analysis.ratings_file import Row, rows_of, simulate, write_export
from tests.helpers.faces import faces

FACES, SEEN, PEOPLE = 6, 3, 30
EXPERIMENT = faces(FACES, SEEN)
FACE_SD, EFFECT_SD = 0.5, 0.6


def simulated() -> list[Row]:
    """Ratings in which profiles differ on each face its own way, and not at all on average over faces."""
    random = np.random.default_rng(4)
    face = dict(zip([f"f{k}" for k in range(FACES)], random.normal(0, FACE_SD, FACES), strict=True))
    own = random.normal(0, EFFECT_SD, (FACES, 3))
    template = rows_of(EXPERIMENT, simulate(EXPERIMENT, 2, trials=1))[0]
    profiles = [level.name for level in EXPERIMENT.factor("profile").levels]
    rows = []
    for who in range(PEOPLE):
        liking = random.normal(0, 0.6)
        for number, trial in enumerate(CLIP_RATING.assign(EXPERIMENT, who, who)):
            if trial.kind != "main" or trial.clip is None:
                continue
            name, profile = trial.clip.level("face"), trial.clip.level("profile")
            mean = 4 + liking + face[name] + own[int(name[1:]), profiles.index(profile)]
            given = int(np.clip(np.rint(mean + random.normal(0, 0.8)), 1, 7))
            row = template | {"run": f"run{who}", "participant": f"P{who:02d}", "trial_index": number}
            rows.append(
                row | {"face": name, "profile": profile, "exemplar": trial.clip.exemplar, "response": given}
            )
    return rows


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    written = write_export(tmp_path_factory.mktemp("faces") / "r.csv", EXPERIMENT, simulated())
    return analyse_study(EXPERIMENT, load_csv(written, EXPERIMENT, READING))


def test_means_are_over_the_faces_that_each_saw(analysis: Analysis) -> None:
    assert analysis.anova.factors == ("profile",)
    assert analysis.n_participants == PEOPLE
    assert analysis.exclusions is not None
    rows = analysis.exclusions.rows
    own = rows[(rows["participant"] == "P03") & (rows["profile"] == "SL")]["response"].mean()
    at = analysis.cells.participants.index("P03")
    assert analysis.anova.y[at, analysis.cells.levels[0].index("SL")] == pytest.approx(own)


def test_the_mixed_model_counts_faces_as_a_sample(analysis: Analysis) -> None:
    """Differences between faces are not an effect of the profile: its test has the df of a few faces."""
    assert analysis.exclusions is not None
    section = mixed_model(analysis)
    (table,) = section.tables
    assert "(1 + profile || face)" in table.notes[0]
    assert "face: random" in section.text
    assert table.rows[0][-1] == "others of face"
    common = (analysis.exclusions.rows, "participant", "response", ["profile"], ["face", "exemplar"])
    random = fit_mixed(*common, random=["face"], random_slopes="all").effects[0]
    fixed = fit_mixed(*common).effects[0]
    assert table.rows[0][1] == f"{random.f_value:.3f}"
    # Several columns name one grouping; to R a slash would add one of faces alone.
    assert "(1 | face:exemplar)" in ordinal_model(analysis).tables[0].notes[0]
    ours = analysis.anova.effect("profile").univariate.p_gg
    assert bool(section.sentences) == (ours < 0.05)
    # 6 faces x 3 profiles leave 10 df at most; without them hundreds of trials pass for evidence.
    assert random.df_error < 15 < fixed.df_error
    assert random.p_value > 0.05 > fixed.p_value


def trials(seed: int, people: int = 24, per_cell: int = 2, group: bool = False) -> pd.DataFrame:
    """Ratings whose A:B (with `group`, G:A) differs from face to face, and is 0 on average."""
    random = np.random.default_rng(seed)
    signs = np.array([[1, -1], [-1, 1]])
    own = random.normal(0, 0.5, FACES)
    rows = []
    for who, face, a, b, exemplar in product(
        range(people), range(FACES), range(2), range(2), range(1, 1 + per_cell)
    ):
        differs = own[face] * (signs[who % 2, a] if group else signs[a, b])
        rating = 4 + differs + random.normal(0, 0.8)
        rows.append((f"P{who}", f"g{who % 2}", f"f{face}", f"a{a}", f"b{b}", exemplar, rating))
    return pd.DataFrame(rows, columns=["who", "G", "face", "A", "B", "exemplar", "rating"])


def arguments(rows: pd.DataFrame, between: tuple[str, ...] = ()) -> dict[str, Any]:
    item = ["face", "A", "B", "exemplar"]
    common = {"rows": rows, "participant": "who", "rating": "rating", "within": ["A", "B"]}
    return common | {"between": list(between), "item": item}


@pytest.mark.parametrize(("effect", "group"), [("A:B", False), ("G:A", True)])
def test_an_interaction_that_differs_between_faces_is_not_an_effect(effect: str, group: bool) -> None:
    """Of 16 sets without an effect one or so is below .05; with slopes of main effects six are."""
    below = 0
    for seed in range(16):
        given = arguments(trials(seed, people=12, group=group), ("G",) if group else ())
        fitted, slopes = fit_with_random(given, ["face"], every=True)
        assert slopes == "all"
        tested = next(e for e in fitted.effects if e.effect == effect)
        below += tested.p_value < 0.05
    assert below <= 2


def test_slopes_of_faces_are_those_of_participants_seen_from_the_other_side() -> None:
    rows, common = trials(1), {"rating": "rating", "within": ["A", "B"], "item": ["face", "exemplar"]}
    ours = fit_mixed(rows, "who", **common, slopes="none", random=["face"], random_slopes="all")
    theirs = fit_mixed(rows, "face", **common, slopes="all", random=["who"])
    assert ours.reml_criterion == pytest.approx(theirs.reml_criterion, abs=1e-6)
    for mine, other in zip(ours.effects, theirs.effects, strict=True):
        assert mine.p_value == pytest.approx(other.p_value, abs=1e-5)


def test_what_is_not_fitted_holds_for_the_faces_shown() -> None:
    fitted, slopes = fit_with_random(arguments(trials(1)), ["face"], every=False)
    assert slopes == "main"
    assert "(1 + A + B || face)" in fitted.formula
    assert holds_for("A", ["face"], slopes) == "others of face"
    assert holds_for("A:B", ["face"], slopes) == "the face shown"
    assert "tests of interactions hold only for the levels shown" in said_of_random(["face"], slopes)
    assert holds_for("A", ["face"], "none") == "the face shown"


def test_one_clip_per_cell_is_not_a_grouping_with_the_slopes() -> None:
    fitted, slopes = fit_with_random(arguments(trials(1, per_cell=1)), ["face"], every=True)
    assert slopes == "all"
    assert fitted.n_items == 0


def test_the_ordinal_model_says_what_its_test_holds_for(analysis: Analysis) -> None:
    section = ordinal_model(analysis)
    assert "Items are the blinks of each face" in section.text
