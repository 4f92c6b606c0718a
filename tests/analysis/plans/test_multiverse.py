"""The multiverse: every choice among declared rules gives what an experiment that declares it gives."""

from pathlib import Path

import pytest

from analysis.plans.clip_rating import PLAN, READING, analyse, contents, multiverse_section
from analysis.plans.multiverse import MAX_RULES, multiverse
from analysis.plans.plan import prepare
from analysis.read.study_answers import load_csv
from analysis.report.write import write_report
from analysis.within.simple_effects import first_test
from experiments import rules
from experiments.errors import InputError
from experiments.load import load_experiment
from tests.analysis.ratings_file import Row, change, rows_of, simulate, write_export

EXP3 = load_experiment("exp3")
FAST, FLAT = rules.ExcludeFast(below_ms=200), rules.ExcludeStraightLining()


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    """Eight people: one too fast, one who always gives the same answer."""
    rows = rows_of(EXP3, simulate(EXP3, 8, trials=3))
    rows = change(rows, lambda row: row["run"] == "run3", rt=150)
    return change(rows, lambda row: row["run"] == "run5", response=4)


def prepared_with(folder: Path, rows: list[Row], *chosen):
    experiment = EXP3.model_copy(update={"exclusions": chosen})
    answers = load_csv(write_export(folder / "r.csv", experiment, rows), experiment, READING)
    return prepare(experiment, PLAN, answers)


def test_each_choice_is_the_analysis_of_an_experiment_that_declares_it(tmp_path, rows) -> None:
    result = multiverse(prepared_with(tmp_path, rows, FAST, FLAT), analyse)
    assert [universe.applied for universe in result.universes] == [
        (True, True),
        (True, False),
        (False, True),
        (False, False),
    ]
    assert [universe.n_participants for universe in result.universes] == [6, 7, 7, 8]
    assert [universe.declared for universe in result.universes] == [True, False, False, False]
    for universe in result.universes:
        chosen = [rule for rule, applies in zip((FAST, FLAT), universe.applied, strict=True) if applies]
        alone = analyse(prepared_with(tmp_path, rows, *chosen)).anova.effects[0]
        first = first_test(alone, multivariate=True)
        assert first is not None
        assert universe.p_values == (first.p_value,)
        assert universe.sizes == (first.eta_sq_partial,)


def test_many_rules_are_left_out_one_at_a_time(tmp_path, rows) -> None:
    many = [rules.ExcludeFast(below_ms=100.0 + step) for step in range(MAX_RULES + 1)]
    result = multiverse(prepared_with(tmp_path, rows, *many), analyse)
    assert len(result.universes) == len(many) + 2
    assert result.rules[:2] == ("median_response_time (1)", "median_response_time (2)")


def test_an_effect_that_no_choice_can_test_has_no_range(tmp_path, rows) -> None:
    flat = change(rows, lambda row: True, response=4)
    prepared = prepared_with(tmp_path, flat, FAST)
    section = multiverse_section(analyse(prepared), prepared, analyse)
    assert section.tables[0].rows[0][1:3] == ("–", "–")


def test_a_choice_that_cannot_be_analysed_is_counted(tmp_path, rows) -> None:
    def refusing(prepared):
        if not prepared.experiment.exclusions:
            raise InputError("no")
        return analyse(prepared)

    result = multiverse(prepared_with(tmp_path, rows, FAST), refusing)
    assert (len(result.universes), result.n_failed) == (1, 1)


def test_choices_that_keep_the_same_rows_are_analysed_once(tmp_path, rows) -> None:
    asked = []

    def counting(prepared):
        asked.append(prepared.experiment.exclusions)
        return analyse(prepared)

    idle = rules.ExcludeFast(below_ms=1)
    result = multiverse(prepared_with(tmp_path, rows, idle, FLAT), counting)
    assert len(result.universes) == 4
    assert asked == [(idle, FLAT), (idle,)]
    assert result.universes[0].p_values == result.universes[2].p_values != result.universes[1].p_values


def test_the_report_shows_table_and_figure(tmp_path, rows) -> None:
    written = write_report(contents(prepared_with(tmp_path, rows, FAST, FLAT)), tmp_path / "out", more=True)
    assert "figure-multiverse.svg" in {path.name for path in written}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Multiverse of exclusions" in page
    assert "Effects by permutation and by aligned ranks" in page
    assert "4 analyses" in page
    assert "Multiverse of exclusions (synthetic data)](" in (tmp_path / "out" / "report.md").read_text(
        encoding="utf-8"
    )


def test_without_rules_there_is_nothing_to_vary(tmp_path, rows) -> None:
    written = write_report(contents(prepared_with(tmp_path, rows)), tmp_path / "out", more=True)
    assert "figure-multiverse.svg" not in {path.name for path in written}
    assert "nothing to vary" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
