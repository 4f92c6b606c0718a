"""check-paper finds what the paper's figures say about themselves, and lets sound figures be."""

import pytest

from analysis.paper.check import Finding, check_paper, check_study, possible
from analysis.paper.printed import SHIPPED, PrintedInterval, PrintedStudy, load_figures
from experiments.errors import InputError


@pytest.fixture(scope="module")
def findings() -> tuple[Finding, ...]:
    return check_paper(load_figures(SHIPPED))


def found(findings, study: str, check: str) -> list[Finding]:
    return [f for f in findings if f.study == study and f.check == check]


def test_item_1_the_df_are_multivariate(findings) -> None:
    (two,) = found(findings, "Experiment 2", "df")
    (three,) = found(findings, "Experiment 3", "df")
    assert "the tests are multivariate" in two.why
    for univariate in ("profile (4, 168)", "duration (3, 126)", "profile:duration (12, 504)"):
        assert univariate in two.why
    assert "lower_lid (3, 57)" in three.why


def test_item_2_table_three_prints_sds(findings) -> None:
    errors = found(findings, "Experiment 3", "SE or SD")
    assert len(errors) == 4
    assert all(f.kind == "impossible" for f in errors)
    assert "means an SD of 3.71" in errors[0].why
    assert "the SE is 0.19" in errors[0].why
    assert not found(findings, "Experiment 1", "SE or SD")


def test_item_3_one_f_is_cut_off_in_the_text(findings) -> None:
    (twice,) = found(findings, "Experiment 1", "printed twice")
    assert "5.917 rounds to 5.92; 5.91 is cut off" in twice.why


def test_item_4_table_one_cannot_hold(findings) -> None:
    (joint,) = found(findings, "Experiment 1", "joint means")
    assert joint.kind == "impossible"
    assert "8.400 <= model + real" in joint.why
    assert "NC + FC < 8.400" in joint.why
    for repair in ("model 4.30", "real 4.09", "NC 3.94", "FC 4.47"):
        assert repair in joint.why
    assert not found(findings, "Experiment 2", "joint means")
    assert not found(findings, "Experiment 3", "joint means")


def test_item_5_the_correction_concerns_the_pairs(findings) -> None:
    assert found(findings, "Experiment 1", "correction")[0].about.startswith("character F(1, 31)")


def test_item_7_the_implied_correlations(findings) -> None:
    said = [f.why.split("correlation of ")[1][:4] for f in found(findings, "Experiment 1", "correlation")]
    assert said == ["0.59", "0.97", "0.95", "0.57"]


def test_every_printed_p_of_the_paper_fits_its_f(findings) -> None:
    assert not [f for f in findings if f.check == "p"]


def study(**changes) -> PrintedStudy:
    base = {"name": "S", "participants": 20, "scale": (1, 7), "factors": {"A": ("x", "y", "z")}}
    return PrintedStudy.model_validate(base | changes)


@pytest.mark.parametrize(
    ("test", "checks"),
    [
        ({"effect": "A", "f": "4.10", "df": (2, 38), "p": "0.02"}, {"df"}),
        ({"effect": "A", "f": "4.10", "df": (2, 38), "p": "0.20"}, {"df", "p"}),
        ({"effect": "A", "f": "4.10", "df": (2, 17)}, {"df"}),
        ({"effect": "A", "f": "4.10", "df": (2, 18), "p": "<0.001"}, {"df", "p"}),
        ({"effect": "A", "f": "4.10", "p": ">0.05"}, {"p"}),
        ({"effect": "A", "f": "4.10", "p": "0.03"}, set()),
    ],
)
def test_df_and_p_are_recomputed(test, checks) -> None:
    assert {f.check for f in check_study(study(test=(test,)))} == checks


def test_univariate_df_are_reported_and_mixing_is_doubted() -> None:
    tests = ({"effect": "A", "f": "3", "df": (2, 38)}, {"effect": "A:B", "f": "3", "df": (4, 16)})
    both = {"factors": {"A": ("x", "y", "z"), "B": ("k", "l", "m")}, "test": tests}
    kinds = [f.kind for f in check_study(study(**both))]
    assert kinds.count("note") == 2
    assert "doubt" in kinds


def test_two_different_values_of_one_f_contradict() -> None:
    tests = ({"effect": "A", "f": "3.10"}, {"effect": "A", "f": "4.2"})
    (finding,) = check_study(study(test=tests))
    assert finding.why == "two different values"


def test_means_that_fit_are_possible_and_cells_bind_margins() -> None:
    factors = {"A": ("x", "y"), "B": ("k", "l")}
    cells = [{"at": {"A": a, "B": b}, "mean": "4.0"} for a in "xy" for b in "kl"]
    fits = study(factors=factors, mean=(*cells, {"at": {"A": "x"}, "mean": "4.04"}))
    clash = study(factors=factors, mean=(*cells, {"at": {"A": "x"}, "mean": "4.10"}))
    assert possible(fits, fits.mean)
    assert not possible(clash, clash.mean)
    assert any("cannot all hold" in f.why for f in check_study(clash))


def test_an_impossible_correlation_is_found() -> None:
    means = tuple({"at": {"A": a}, "mean": m, "error": "0.10"} for a, m in (("x", "3.00"), ("y", "4.00")))
    wrong = study(factors={"A": ("x", "y")}, mean=means, test=({"effect": "A", "f": "2.00"},))
    assert [f.check for f in check_study(wrong) if f.kind == "impossible"] == ["correlation"]


def test_rounding_keeps_the_printed_digits() -> None:
    number = PrintedInterval.of("4.10")
    assert (str(number.low), str(number.high), str(number.unit)) == ("4.095", "4.105", "0.01")


HEAD = 'title = "t"\n[[study]]\nname = "a"\nparticipants = 3\nfactors = { A = ["x", "y"] }\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("title = ", "not valid TOML"),
        ('title = "t"', "study"),
        (HEAD + "[[study.meen]]", "unknown key; did you mean 'mean'"),
        (HEAD + 'mean = [{ at = { B = "x" }, mean = "1" }]', "no factor is called 'B'"),
        (HEAD + 'mean = [{ at = { A = "q" }, mean = "1" }]', "'q' is not a level of 'A'"),
        (HEAD + 'test = [{ effect = "A:C", f = "1" }]', "no factor is called 'C'"),
        (HEAD + 'test = [{ effect = "A", f = "big" }]', "expected a number as printed, in quotes"),
    ],
)
def test_a_wrong_figures_file_is_refused_in_one_line(tmp_path, text, message) -> None:
    path = tmp_path / "f.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        load_figures(path)
    assert "\n" not in str(caught.value)


def test_a_missing_figures_file_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="omit the name"):
        load_figures(tmp_path / "none.toml")
