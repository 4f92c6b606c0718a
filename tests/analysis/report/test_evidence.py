"""Verdicts are counted before exclusions, the signals of a runs file are summed up, and rules use both."""

import csv
from dataclasses import replace

import pytest

from analysis.plans.clip_rating import READING
from analysis.plans.plan import study_contents
from analysis.read.study_answers import load_csv, read_runs
from analysis.report.write import write_report
from experiments.errors import InputError
from experiments.load import load_experiment
from experiments.rules import ExcludeEvidence
from tests.analysis.ratings_file import rows_of, simulate, write_export

EXP3 = load_experiment("exp3")
RULE = EXP3.model_copy(update={"exclusions": (ExcludeEvidence(verdicts=("unlikely", "unclear")),)})


@pytest.fixture
def answers(tmp_path):
    return load_csv(
        write_export(tmp_path / "r.csv", EXP3, rows_of(EXP3, simulate(EXP3, 6, trials=5))), EXP3, READING
    )


@pytest.fixture
def runs(tmp_path):
    """Four likely, one unclear, one unlikely; a seventh is of another study."""
    verdicts = ["likely"] * 4 + ["unclear", "unlikely", "unlikely"]
    rows = [
        {
            "run": f"run{i}",
            "evidence_verdict": verdict,
            "evidence_tickets": 1,
            "evidence_rt_median": 100 * i or "",
        }
        for i, verdict in enumerate(verdicts)
    ]
    path = tmp_path / "runs.csv"
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return read_runs(path)


def test_counts_and_signals_are_in_page_and_numbers(answers, runs, tmp_path) -> None:
    contents = study_contents(RULE, answers, runs=runs)
    assert contents.numbers["evidence"]["verdicts"] == {
        "likely": 4,
        "unclear": 1,
        "unlikely": 1,
        "not_judged": 0,
    }
    signals = contents.numbers["evidence"]["signals"]
    assert signals["rt_median"] == {"runs": 5, "median": 300.0, "minimum": 100.0, "maximum": 500.0}
    assert contents.n_participants == 4
    assert {run["reasons"][0] for run in contents.numbers["exclusions"]["runs"]} == {
        "evidence_verdict: unclear",
        "evidence_verdict: unlikely",
    }
    assert contents.evidence is not None
    assert [table.title for table in contents.evidence.tables] == [
        "Runs by verdict, before exclusions [SYNTHETIC DATA]",
        "Signals of the runs [SYNTHETIC DATA]",
    ]
    write_report(contents, tmp_path / "report")
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "Runs by verdict, before exclusions" in page
    assert "rt_median: Median response time of main trials. In ms." in page
    assert "rt_median" in (tmp_path / "report" / "report.md").read_text(encoding="utf-8")


def test_runs_without_signals_have_no_table_of_them(answers, runs) -> None:
    contents = study_contents(RULE, answers, runs=replace(runs, signals=runs.signals.iloc[:0]))
    assert contents.evidence is not None
    assert [table.key for table in contents.evidence.tables] == ["evidence-verdicts"]


def test_data_from_before_there_were_verdicts_say_so(answers) -> None:
    older = replace(answers, rows=answers.rows.drop(columns="evidence_verdict"))
    contents = study_contents(RULE, older)
    assert contents.evidence is None
    assert (
        "rule not applied: evidence_verdict: the data have no column 'evidence_verdict'" in contents.left_out
    )


def test_a_file_that_is_not_a_runs_csv_is_refused(tmp_path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("run,rt\nr1,5\n", encoding="utf-8")
    with pytest.raises(InputError, match="evidence_verdict"):
        read_runs(path)
