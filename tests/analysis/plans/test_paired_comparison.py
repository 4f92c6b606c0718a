"""A study of pairs from its export: the same rules as ratings, abilities, and what cannot be fitted said."""

import dataclasses
import re

import numpy as np
import pytest
import statsmodels.api as sm
from scipy import stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.plans.paired_comparison import READING
from analysis.plans.plan import study_contents
from analysis.read.pool import Origin, Pool
from analysis.read.study_answers import load_csv
from experiments import rules
from experiments.declaration.factors import Factor, Level
from experiments.declaration.paired_comparison import WithinFactor
from experiments.errors import InputError
from experiments.load import load_experiment
from experiments.schema.canonical import definition_sha256
from tests.analysis.comparisons_file import compare, row_of, write_comparisons
from tests.analysis.ratings_file import change
from tests.conftest import REPOSITORY

DEMO = load_experiment(str(REPOSITORY / "experiments" / "pairs-demo.toml"))
ABILITIES = {
    "photorealistic/model": 0.8,
    "photorealistic/textbook": 0.0,
    "cartoon/model": 0.4,
    "cartoon/textbook": -0.3,
}


@pytest.fixture
def rows() -> list[dict]:
    return compare(DEMO, ABILITIES, 12)


def report(tmp_path, rows, experiment=DEMO, pool=Pool()):
    path = write_comparisons(tmp_path / "comparisons.csv", rows)
    return study_contents(experiment, load_csv(path, experiment, READING), pool)


def with_rules(*chosen):
    return DEMO.model_copy(update={"exclusions": chosen})


def test_abilities_are_those_of_a_logistic_regression(tmp_path, rows) -> None:
    numbers = report(tmp_path, rows).numbers
    cells = list(ABILITIES)[1:]

    def sides(row: dict) -> list[float]:
        return [float(row["left_cell"] == cell) - float(row["right_cell"] == cell) for cell in cells]

    design = np.array([sides(row) for row in rows])
    theirs = sm.Logit([row["winner"] == "left" for row in rows], design).fit(disp=0)
    items = {item["name"]: item for item in numbers["abilities"]["items"]}
    assert list(items) == list(ABILITIES)
    assert [items[cell]["ability"] for cell in cells] == pytest.approx(theirs.params, abs=1e-6)
    assert [items[cell]["se"] for cell in cells] == pytest.approx(theirs.bse, abs=1e-6)
    equal = 2 * (theirs.llf - len(rows) * np.log(0.5))
    assert numbers["equal_abilities"]["chi2"] == pytest.approx(equal)
    assert numbers["equal_abilities"]["p"] == pytest.approx(stats.chi2.sf(equal, 3))


def test_factors_have_the_declared_order_of_levels(tmp_path, rows) -> None:
    tests = {test["factor"]: test for test in report(tmp_path, rows).numbers["factors"]}
    assert list(tests) == ["character", "blink", "lack of fit"]
    assert (tests["character"]["reference"], tests["character"]["levels"]) == ("photorealistic", ("cartoon",))
    assert tests["lack of fit"]["df"] == 1


def test_ties_are_davidsons_third_outcome(tmp_path) -> None:
    rows = compare(DEMO, dict.fromkeys(ABILITIES, 0.0), 12, nu=0.7)
    numbers = report(tmp_path, rows).numbers
    ties = np.mean([row["winner"] == "tie" for row in rows])
    assert numbers["abilities"]["method"] == "davidson"
    assert 0.1 < numbers["abilities"]["tie_probability_max"] < 0.45
    equal = len(rows) * (ties * np.log(ties) + (1 - ties) * np.log((1 - ties) / 2))
    chi2 = 2 * (numbers["abilities"]["log_likelihood"] - equal)
    assert numbers["equal_abilities"]["chi2"] == pytest.approx(chi2)


def test_screening_of_ratings_is_not_applied_to_choices_and_the_report_says_so(tmp_path, rows) -> None:
    found = report(tmp_path, rows, with_rules(rules.ScreenByBT500()))
    assert found.n_participants == 12
    assert any("bt500: trials of this kind have no ratings on a scale" in line for line in found.left_out)


@pytest.mark.parametrize(
    ("rule", "values", "reason"),
    [
        (rules.ExcludeIncomplete(), {"run_status": "active"}, "incomplete: run is active"),
        (
            rules.ExcludeStraightLining(),
            {"winner": "left"},
            "same_response_share: 100% of answers are the same",
        ),
        (rules.ExcludeFast(below_ms=200), {"rt": 150}, "median_response_time: median 150 ms"),
        (rules.ExcludePlayback(more_than=0.2), {"verdict": "flagged"}, "poor_playback_share: 100% of plays"),
    ],
)
def test_rules_exclude_as_of_ratings(tmp_path, rows, rule, values, reason) -> None:
    found = report(tmp_path, change(rows, lambda row: row["run"] == "r3", **values), with_rules(rule))
    assert found.n_participants == 11
    (excluded,) = found.numbers["exclusions"]["runs"]
    assert excluded["participant"] == "P03"
    assert excluded["reasons"][0].startswith(reason)


def test_a_check_is_failed_by_another_answer_than_asked(tmp_path, rows) -> None:
    checks = [
        row_of(DEMO, person, 99)
        | {"kind": "attention", "expected_response": 2, "winner": "right" if person else "left"}
        for person in range(12)
    ]
    found = report(tmp_path, rows + checks, with_rules(rules.ExcludeAttention()))
    assert [run["participant"] for run in found.numbers["exclusions"]["runs"]] == ["P00"]


def in_two_series(rows, first: str, second: str):
    """The same answers in two data series, each under a declaration with this hash."""
    both = []
    for series, digest in enumerate((first, second), start=1):
        of = {"data_series": series, "study_version": series, "definition_sha256": digest}
        both += [row | of | {"run": f"{row['run']}-{series}"} for row in rows]
    return both


def test_a_declaration_chooses_the_series_that_was_made_with_it(tmp_path, rows) -> None:
    own = definition_sha256(DEMO)
    for first, second, series in ((own, "f" * 64, 1), ("f" * 64, own, 2), ("e" * 64, "f" * 64, 2)):
        said = report(tmp_path, in_two_series(rows, first, second)).decisions
        assert said[0] == f"simulated responses, data series {series}"
        assert f"data series {series}: {len(rows)} other rows were ignored" in said
        assert not any("used and analyzed together" in line for line in said)
        foreign = [
            line for line in said if "a different declaration than the one used here; find theirs on" in line
        ]
        assert bool(foreign) == (own not in (first, second))


def test_versions_of_one_series_are_counted_without_those_left_aside(tmp_path, rows) -> None:
    rows = in_two_series(rows, "e" * 64, definition_sha256(DEMO))
    rows = change(rows, lambda row: row["run"] == "r3-2", definition_sha256="d" * 64)
    said = report(tmp_path, rows).decisions
    assert "2 versions of the experiment's declaration were used and analyzed together" in said


def test_origins_are_not_pooled(tmp_path, rows) -> None:
    mixed = change(rows, lambda row: row["run"] == "r1", run_origin="participant", synthetic=0)
    found = report(tmp_path, mixed)
    assert (found.n_participants, found.synthetic) == (1, False)
    assert "only responses of origin participant were analyzed" in found.decisions
    assert any("132 rows of other origins" in said for said in found.left_out)
    assert report(tmp_path, mixed, pool=Pool(Origin.ALL)).n_participants == 12


def in_three_versions(rows):
    """Version 1 of simulated people, 2 and 3 of the second series, version 3 of participants alone."""
    own = definition_sha256(DEMO)
    both = in_two_series(rows, own, own)
    third = {"data_series": 2, "study_version": 3, "run_origin": "participant", "synthetic": 0}
    return both + [row | third | {"run": f"{row['run']}-3"} for row in rows]


def test_a_version_is_the_answers_given_under_it_alone(tmp_path, rows) -> None:
    found = report(tmp_path, in_three_versions(rows), pool=Pool(version=2))
    assert found.n_participants == 12
    assert found.decisions[:2] == (
        "simulated responses, data series 2, only version 2",
        f"study version 2: {2 * len(rows)} other rows were ignored",
    )
    # The first origin there is would be participant: of this version there is another.
    assert not report(tmp_path, in_three_versions(rows), pool=Pool(version=3)).synthetic
    said = report(tmp_path, in_three_versions(rows), pool=Pool(series=2)).decisions
    assert said[0] == "participant responses, data series 2"


@pytest.mark.parametrize(
    ("pool", "words"),
    [
        (Pool(version=4), "no responses of study version 4; it has data series 1 (version 1), "),
        (Pool(series=3), "no responses of data series 3; it has data series 1 (version 1), "),
        (Pool(version=3, series=1), "no responses of data series 1; it has data series 2 (version"),
        (Pool(Origin.PILOT, version=3), "has no ratings of origin 'pilot' under version 3 yet"),
    ],
)  # fmt: skip
def test_an_unknown_version_or_series_is_refused_with_those_there_are(tmp_path, rows, pool, words) -> None:
    with pytest.raises(InputError, match=re.escape(words)) as refused:
        report(tmp_path, in_three_versions(rows), pool=pool)
    if pool.version == 4:
        assert str(refused.value).endswith("data series 2 (versions 2, 3)")


def test_rows_without_versions_are_reported(tmp_path, rows) -> None:
    bare = [{key: value for key, value in row.items() if key != "study_version"} for row in rows]
    with pytest.raises(InputError, match="does not record the study version of its rows; do not choose"):
        report(tmp_path, bare, pool=Pool(version=1))


BEST = "photorealistic/model"


def always_winning(rows: list[dict]) -> list[dict]:
    made = []
    for row in rows:
        sides = {row["left_cell"]: "left", row["right_cell"]: "right"}
        made.append(row | {"winner": sides.get(BEST, row["winner"])})
    return made


def test_a_cell_that_always_wins_is_said_and_finite(tmp_path, rows) -> None:
    found = report(tmp_path, always_winning(rows))
    assert "Firth's penalty" in found.parts[0].sentences[0]
    assert found.numbers["abilities"]["items"][0]["rank"] == 1
    assert found.numbers["equal_abilities"] is None


def test_what_cannot_be_fitted_has_its_counts_and_its_reason(tmp_path) -> None:
    rows = always_winning(compare(DEMO, ABILITIES, 12, nu=0.7))
    found = report(tmp_path, rows)
    assert found.numbers["abilities"] is None
    assert f"{BEST} won every comparison" in found.numbers["abilities_reason"]
    # Labels, and no option of a command: those are for the terminal.
    assert found.parts[0].sentences == (
        "The Davidson model could not be fitted by maximum likelihood, because Photorealistic, From the "
        "model won every comparison with the others.",
    )
    assert "robust" not in found.methods
    assert "ransitivity" not in found.methods
    assert [table.key for table in found.parts[0].tables] == ["pair-choices"]
    assert sum(pair["n"] for pair in found.numbers["pairs"]) == len(rows)


def test_two_clips_of_one_cell_are_left_out_and_said(tmp_path, rows) -> None:
    same = rows[0] | {"left_cell": "cartoon/model", "right_cell": "cartoon/model", "trial_index": 90}
    found = report(tmp_path, [*rows, same])
    assert found.numbers["n_comparisons"] == len(rows)
    assert any("1 comparison of two clips of one cell" in said for said in found.decisions)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"winner": "lefft"},
            "participant P00, trial 2: 'lefft' is not a valid answer .*did you mean 'left'",
        ),
        (
            {"left_cell": "cartoon/modl"},
            "'cartoon/modl' is not a valid cell of this experiment; did you mean",
        ),
        ({"participant": ""}, "'participant' is empty"),
    ],
)
def test_wrong_rows_are_refused_by_participant_and_trial(tmp_path, rows, values, message) -> None:
    first = rows[0]["trial_index"]
    wrong = change(rows, lambda row: row["run"] == "r0" and row["trial_index"] == first, **values)
    with pytest.raises(InputError, match=message):
        report(tmp_path, wrong)


def test_a_tie_that_is_not_declared_is_refused(tmp_path, rows) -> None:
    strict = DEMO.model_copy(update={"trial": DEMO.trial.model_copy(update={"ties": None})})
    with pytest.raises(InputError, match="'tie' is not a valid answer"):
        report(tmp_path, [rows[0] | {"winner": "tie"}, *rows[1:]], strict)


def test_every_table_sentence_and_figure_of_simulated_data_says_so(tmp_path, rows) -> None:
    path = write_comparisons(tmp_path / "comparisons.csv", rows)
    command = ["run", str(REPOSITORY / "experiments" / "pairs-demo.toml"), "--csv", str(path)]
    done = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "SYNTHETIC DATA: no person gave these comparisons" in done.stdout
    assert max(map(len, done.stdout.replace(str(tmp_path), "").splitlines())) <= 80
    made = {file.name for file in (tmp_path / "out").iterdir()}
    assert {"report.html", "report.md", "tables.tex", "results.json", "figure-abilities.svg"} <= made
    found = report(tmp_path, rows)
    assert all("[SYNTHETIC DATA]" in table.title for table in found.parts[0].tables)
    assert "Synthetic data" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "0 inconsistent" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")


def test_the_same_comparisons_give_the_same_report(tmp_path, rows) -> None:
    one, two = (report(tmp_path, rows).parts[0] for _ in range(2))
    assert dataclasses.replace(one, draw=two.draw, more=two.more, beside=two.beside) == two
    assert one.beside("") == two.beside("")
    assert [picture.svg for picture in one.draw()] == [picture.svg for picture in two.draw()]


GROUPED = DEMO.model_copy(
    update={
        "factors": (DEMO.factors[0].model_copy(update={"between": True}), DEMO.factors[1]),
    }
)


@pytest.mark.parametrize(("cartoon", "agree"), [(0.9, True), (-1.8, False)])
def test_groups_are_analysed_for_themselves_and_compared(tmp_path, cartoon, agree) -> None:
    abilities = ABILITIES | {"photorealistic/model": 0.9, "cartoon/model": cartoon, "cartoon/textbook": 0.0}
    found = report(tmp_path, compare(GROUPED, abilities, 80, nu=0.5), GROUPED)
    drawn, baked = found.numbers["groups"][1], found.numbers["groups"][0]
    assert (baked["group"], drawn["group"]) == ("photorealistic", "cartoon")
    assert [item["name"] for item in baked["abilities"]["items"]] == [
        "photorealistic/model",
        "photorealistic/textbook",
    ]
    assert (baked["n_participants"], drawn["n_participants"], found.n_participants) == (40, 40, 80)
    assert [part.title for part in found.parts] == [
        "Character: Photorealistic",
        "Character: Cartoon",
        "Agreement of the groups",
    ]
    assert len({table.key for part in found.parts for table in part.tables}) == sum(
        len(part.tables) for part in found.parts
    )
    # One ability and one for ties per group; two groups.
    assert found.numbers["agreement"]["df"] == 2
    assert (found.numbers["agreement"]["p"] > 0.05) == agree


def test_the_agreement_of_groups_is_the_deviance_between_two_logistic_regressions(tmp_path) -> None:
    abilities = ABILITIES | {"cartoon/model": -0.2, "cartoon/textbook": 0.0}
    rows = compare(GROUPED, abilities, 60)
    found = report(tmp_path, rows, GROUPED)
    side = np.array([1.0 if row["left_cell"].endswith("/model") else -1.0 for row in rows])
    drawn = np.array([row["left_cell"].startswith("cartoon/") for row in rows], dtype=float)
    left = [row["winner"] == "left" for row in rows]
    both = sm.Logit(left, np.column_stack([side, side * drawn])).fit(disp=0)
    one = sm.Logit(left, side[:, None]).fit(disp=0)
    assert found.numbers["agreement"]["chi2"] == pytest.approx(2 * (both.llf - one.llf), abs=1e-6)
    assert found.numbers["agreement"]["df"] == 1


def within_characters(**abilities: float):
    """The demo with pairs of one character each, and 30 people's choices."""
    pairs = WithinFactor(factor="blink")
    experiment = DEMO.model_copy(update={"trial": DEMO.trial.model_copy(update={"pairs": pairs})})
    rows = [
        row
        for row in compare(DEMO, ABILITIES | abilities, 30)
        if row["left_cell"].split("/")[0] == row["right_cell"].split("/")[0]
    ]
    return experiment, rows


@pytest.mark.parametrize("agree", [True, False])
def test_pairs_within_scenes_have_abilities_that_scenes_share_and_a_test_of_that(tmp_path, agree) -> None:
    """No comparison joins the cells of two characters: of the cells themselves nothing can be fitted."""
    experiment, rows = within_characters(**{"cartoon/textbook": -0.3 if agree else 2.0})
    found = report(tmp_path, rows, experiment)
    sign = np.array([float(row["left_cell"].endswith("textbook")) * 2 - 1 for row in rows])
    left = [row["winner"] == "left" for row in rows]
    cartoon = np.array([row["left_cell"].startswith("cartoon") for row in rows])
    common = sm.Logit(left, sign[:, None]).fit(disp=0)
    own = sm.Logit(left, np.column_stack([sign, sign * cartoon])).fit(disp=0)
    model, textbook = found.numbers["abilities"]["items"]
    assert (model["name"], textbook["name"]) == ("model", "textbook")
    assert textbook["ability"] == pytest.approx(common.params[0], abs=1e-6)
    assert textbook["se"] == pytest.approx(common.bse[0], abs=1e-6)
    chi2 = 2 * (own.llf - common.llf)
    assert found.numbers["within"] == ["character"]
    agreement = found.numbers["agreement"]
    assert (agreement["chi2"], agreement["df"]) == (pytest.approx(chi2, abs=1e-6), 1)
    assert (agreement["p"] < 0.05) is not agree
    *_, said = [sentence for part in found.parts for sentence in part.sentences]
    verdict = "did not differ significantly" if agree else "differed"
    assert said.startswith(f"Abilities {verdict} between the levels of Character, χ²(1) = ")
    assert "Clips were compared only within the same level of Character." in found.methods


def test_a_scene_whose_abilities_cannot_be_fitted_is_named_and_the_rest_is_reported(tmp_path) -> None:
    experiment, rows = within_characters()
    rows = change(rows, lambda row: row["left_cell"] == "cartoon/model", winner="left")
    rows = change(rows, lambda row: row["right_cell"] == "cartoon/model", winner="right")
    found = report(tmp_path, rows, experiment)
    assert found.numbers["abilities"] is not None
    assert found.numbers["agreement"] is None
    said = "textbook lost every comparison with the others, so no finite ability fits"
    assert found.numbers["agreement_reason"] == said


def test_groups_whose_pairs_are_within_scenes_say_so(tmp_path) -> None:
    scene = Factor(
        name="scene", label="Scene", levels=(Level(name="a", label="A"), Level(name="b", label="B"))
    )
    trial = GROUPED.trial.model_copy(update={"pairs": WithinFactor(factor="blink")})
    experiment = GROUPED.model_copy(update={"factors": (*GROUPED.factors, scene), "trial": trial})
    abilities = {f"{cell}/{level}": ability for cell, ability in ABILITIES.items() for level in "ab"}
    rows = [
        row
        for row in compare(experiment, abilities, 60)
        if row["left_cell"].split("/")[2] == row["right_cell"].split("/")[2]
    ]
    found = report(tmp_path, rows, experiment)
    assert found.numbers["within"] == ["scene"]
    assert found.methods.startswith("Clips were compared only within the same level of Scene. ")
    for group in found.numbers["groups"]:
        assert [item["name"].split("/")[1] for item in group["abilities"]["items"]] == ["model", "textbook"]
    assert found.numbers["agreement"]["df"] == 1
