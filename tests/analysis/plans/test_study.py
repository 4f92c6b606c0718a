"""A declared experiment from its export and its database: exclusions by name, checks, the same numbers."""

import random
from typing import ClassVar, Literal

import numpy as np
import pytest
from scipy import stats

from analysis.plans.clip_rating import READING, analyse_study
from analysis.read.database import load_database
from analysis.read.pool import Origin, Pool
from analysis.read.reading import NoRatingsError
from analysis.read.study_answers import load_csv
from analysis.report.json_output import as_data, left_out
from experiments import rules
from experiments.errors import InputError
from experiments.load import load_experiment, locate, parse_experiment
from experiments.rules.exclusions import LeavesOutRuns, RunTrials
from tests.analysis.ratings_file import change, rows_of, simulate, write_export
from tests.analysis.study_database import make_database

EXP3 = load_experiment("exp3")


@pytest.fixture
def rows() -> list[dict]:
    return rows_of(EXP3, simulate(EXP3, 8, trials=5))


def analyse(path, rows, experiment=EXP3, pool=Pool()):
    written = write_export(path / "r.csv", experiment, rows)
    return analyse_study(experiment, load_csv(written, experiment, READING), pool)


def with_rules(*chosen):
    return EXP3.model_copy(update={"exclusions": chosen})


def test_means_are_the_ratings_own(tmp_path, rows) -> None:
    ratings = simulate(EXP3, 8, trials=5)
    analysis = analyse(tmp_path, rows)
    assert analysis.anova.y == pytest.approx(ratings.mean(axis=-1))
    assert analysis.anova.factors == ("lower_lid",)
    assert analysis.synthetic
    assert left_out(analysis.exclusions) == ("No trial was excluded by rule or manually (of 8 participants)",)


def test_export_and_database_give_the_same_numbers(tmp_path, rows) -> None:
    ratings = simulate(EXP3, 8, trials=5)
    url = make_database(tmp_path / "d.sqlite", EXP3, ratings, participants=[f"P{i:02d}" for i in range(8)])
    stored = as_data(analyse_study(EXP3, load_database(url, EXP3, READING)))
    exported = as_data(analyse(tmp_path, rows))
    for key in ("effects", "marginal_means", "pairwise", "n_participants", "participants", "synthetic"):
        assert stored[key] == exported[key], key


@pytest.mark.parametrize(
    ("rule", "values", "reason"),
    [
        (rules.ExcludeIncomplete(), {"run_status": "active"}, "incomplete: run is active"),
        (rules.ExcludePlayback(more_than=0.2), {"verdict": "flagged"}, "poor_playback_share: 100% of plays"),
        (rules.ExcludeStraightLining(), {"response": 4}, "same_response_share: 100% of answers are the same"),
        (rules.ExcludeFast(below_ms=200), {"rt": 150}, "median_response_time: median 150 ms"),
        (rules.ExcludeEvidence(), {"evidence_verdict": "unlikely"}, "evidence_verdict: unlikely"),
    ],
)
def test_a_participant_rule_excludes_by_name_with_its_reason(tmp_path, rows, rule, values, reason) -> None:
    rows = change(rows, lambda row: row["run"] == "run3", **values)
    analysis = analyse(tmp_path, rows, with_rules(rule))
    assert analysis.n_participants == 7
    (excluded,) = analysis.exclusions.runs
    assert excluded.participant == "P03"
    assert excluded.reasons[0].startswith(reason)
    assert any("participant P03 (run run3) excluded" in line for line in left_out(analysis.exclusions))


@pytest.mark.parametrize("rule", [rules.ScreenByBT500(), rules.ScreenByP913()])
def test_a_declared_screening_leaves_out_the_rater_unlike_all_others(tmp_path, rule) -> None:
    """All give the clip's rating, one of them far above and far below it in turn."""
    rows = rows_of(EXP3, simulate(EXP3, 30, trials=5))
    clips = sorted({row["stimulus"] for row in rows})
    quality = {clip: 3 + 2 * (place % 2) for place, clip in enumerate(clips)}
    jitter = random.Random(2)
    changed = []
    for row in rows:
        near = quality[row["stimulus"]] + jitter.choice((-1, *[0] * 18, 1))
        far = 7 if quality[row["stimulus"]] == 3 else 1
        changed.append(row | {"response": far if row["run"] == "run6" else near})
    analysis = analyse(tmp_path, changed, with_rules(rule))
    (excluded,) = analysis.exclusions.runs
    assert excluded.participant == "P06"
    assert excluded.reasons[0].startswith(f"{rule.rule}: ")
    assert any("participant P06 (run run6) excluded" in line for line in left_out(analysis.exclusions))


class ExcludeAnswersInTurn(LeavesOutRuns):
    """A rule that neither the analysis nor anything else knows."""

    rule: Literal["answers_in_turn"] = "answers_in_turn"
    needed: ClassVar[tuple[str, ...]] = ("response",)

    def excludes(self, run: RunTrials) -> str | None:
        given = run.given("response")
        return "1 and 2 in turn" if given == [1 + place % 2 for place in range(len(given))] else None


def test_a_new_rule_is_applied_by_its_own_file_alone(tmp_path, rows) -> None:
    mine = [row for row in rows if row["run"] == "run4"]
    in_turn = {row["trial_index"]: 1 + place % 2 for place, row in enumerate(mine)}
    rows = [row | {"response": in_turn[row["trial_index"]]} if row in mine else row for row in rows]
    analysis = analyse(tmp_path, rows, with_rules(ExcludeAnswersInTurn()))
    (excluded,) = analysis.exclusions.runs
    assert (excluded.participant, excluded.reasons) == ("P04", ("answers_in_turn: 1 and 2 in turn",))


def test_failed_attention_checks_exclude(tmp_path, rows) -> None:
    checks = [
        rows[0] | {"run": f"run{i}", "participant": f"P{i:02d}", "kind": "attention", "trial_index": 99}
        | {"expected_response": 2, "response": 2 if i else 5, "lower_lid": ""}
        for i in range(8)
    ]  # fmt: skip
    analysis = analyse(tmp_path, rows + checks, with_rules(rules.ExcludeAttention(more_than=0)))
    assert [run.participant for run in analysis.exclusions.runs] == ["P00"]
    assert analysis.anova.y.shape == (7, 4)


def test_a_run_without_a_rating_does_not_take_the_place_of_one_with_ratings(tmp_path, rows) -> None:
    """A person who left during the practice and came back is analyzed, and counted once."""
    rows = change(rows, lambda row: True, saved_at="2026-01-02T00:00:00Z")
    begun = {"run": "begun", "kind": "practice", "saved_at": "2026-01-01T00:00:00Z"}
    analysis = analyse(tmp_path, [rows[0] | begun, *rows], with_rules())
    assert analysis.anova.y.shape == (8, 4)
    assert analysis.exclusions.runs == ()
    said = left_out(analysis.exclusions)
    assert said == (
        "No trial was excluded by rule or manually (of 8 participants); 1 practice trial was set aside",
    )


@pytest.mark.parametrize("words", [("1.0", "0.0"), ("TRUE", "FALSE"), ("yes", "")])
def test_exclusion_by_hand_is_read_as_other_programs_write_it(tmp_path, rows, words) -> None:
    out, kept = words
    rows = [row | {"excluded": out if row["run"] == "run1" else kept} for row in rows]
    analysis = analyse(tmp_path, rows, with_rules())
    assert [run.run for run in analysis.exclusions.runs] == ["run1"]
    with pytest.raises(InputError, match="'excluded' is 'maybe' in a row; expected 0 or 1"):
        analyse(tmp_path, [row | {"excluded": "maybe"} for row in rows], with_rules())


def test_exclusion_by_hand_and_later_runs_are_named(tmp_path, rows) -> None:
    rows = change(rows, lambda row: row["run"] == "run1", excluded=1, exclusion_reason="fell asleep")
    rows = change(rows, lambda row: row["run"] == "run5", participant="P02", saved_at="2026-01-02T00:00:00Z")
    rows = change(rows, lambda row: row["run"] == "run2", saved_at="2026-01-01T00:00:00Z")
    analysis = analyse(tmp_path, rows, with_rules())
    reasons = {run.run: run.reasons for run in analysis.exclusions.runs}
    assert reasons["run1"] == ("by hand: fell asleep",)
    assert reasons["run5"] == ("a later run of the same participant",)


@pytest.mark.parametrize(
    ("second", "first"),
    [
        ("2026-01-02T00:00:00Z", "2026-01-01T00:00:00Z"),
        ("2026-01-01 23:30:00-05:00", "2026-01-02 01:00:00+01:00"),
        ("2026-01-01T00:00:00.5Z", "2026-01-01T00:00:00Z"),
    ],
)
def test_the_first_of_two_runs_is_found_by_time_and_not_by_text(tmp_path, rows, second, first) -> None:
    rows = change(rows, lambda row: row["run"] == "run5", participant="P02", saved_at=second)
    rows = change(rows, lambda row: row["run"] == "run2", saved_at=first)
    analysis = analyse(tmp_path, rows, with_rules())
    assert [run.run for run in analysis.exclusions.runs] == ["run5"]


def test_times_that_begin_with_the_day_do_not_decide_which_run_is_the_first(tmp_path, rows) -> None:
    """As text 02.12. is before 30.11.; whether 02/12 is in December or February cannot be seen."""
    rows = change(rows, lambda row: True, saved_at="02.12.2026 10:00")
    assert not analyse(tmp_path, rows, with_rules()).exclusions.runs
    rows = change(rows, lambda row: row["run"] == "run5", participant="P02", saved_at="30.11.2026 09:00")
    with pytest.raises(
        InputError, match=r"'saved_at' is '.*2026 .*' in a row; expected a time such as 2026-11-30"
    ):
        analyse(tmp_path, rows, with_rules())


@pytest.mark.parametrize(
    ("rule", "values"),
    [
        (rules.DropFailedPlays(), {"verdict": "failed"}),
        (rules.DropSlowTrials(above_ms=60_000), {"rt": 70_000}),
    ],
)
def test_a_trial_rule_drops_trials_and_counts_them(tmp_path, rows, rule, values) -> None:
    rows = change(rows, lambda row: row["exemplar"] == 2 and row["run"] in {"run0", "run1"}, **values)
    analysis = analyse(tmp_path, rows, with_rules(rule))
    (dropped,) = analysis.exclusions.trials
    assert (dropped.trials, dropped.participants) == (8, 2)
    assert analysis.cells.counts.min() == 4
    assert any("4 to 5 ratings" in text for text in analysis.decisions)


def test_a_participant_excluded_for_an_empty_cell_contradicts_no_sentence(tmp_path, rows) -> None:
    first, cell = rows[0]["participant"], rows[0]["lower_lid"]
    kept = [row for row in rows if (row["participant"], row["lower_lid"]) != (first, cell)]
    analysis = analyse(tmp_path, kept, with_rules())
    assert left_out(analysis.exclusions) == ("No trial was excluded by rule or manually (of 8 participants)",)
    assert any(f"participant {first} excluded: no rating in" in said for said in analysis.decisions)


def test_practice_pilot_and_unrated_rows_are_set_aside_and_said(tmp_path, rows) -> None:
    extra = [
        rows[0] | {"kind": "practice", "trial_index": 90},
        rows[1] | {"run_origin": "pilot", "trial_index": 91},
    ]
    extra += [rows[2] | {"response": "", "trial_index": 92}]
    analysis = analyse(tmp_path, rows + extra, pool=Pool(Origin.SIMULATED))
    assert "only responses of origin simulated were analyzed" in analysis.decisions
    assert left_out(analysis.exclusions) == (
        "No trial was excluded by rule or manually (of 8 participants); 1 row of other origins, "
        "1 practice trial and 1 presentation without a rating were set aside",
    )


def test_a_rule_whose_column_is_missing_is_said_not_skipped(tmp_path, rows) -> None:
    path = tmp_path / "few.csv"
    lines = [f"{row['participant']},{row['response']},{row['lower_lid']}" for row in rows]
    path.write_text("participant,response,lower_lid\n" + "\n".join(lines))
    analysis = analyse_study(EXP3, load_csv(path, EXP3, READING))
    assert analysis.n_participants == 8
    assert "incomplete: the data have no column 'run_status'" in analysis.exclusions.not_applied


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"response": 9}, "participant P00, trial 0: expected a whole rating from 1 to 7, got 9"),
        ({"response": 2.5}, "expected a whole rating from 1 to 7, got 2.5"),
        ({"response": "five"}, "'response' should be a number, got 'five'"),
        ({"lower_lid": "bothh"}, "'bothh' is not a valid level of 'lower_lid'; did you mean 'both'"),
        ({"participant": ""}, "'participant' is empty"),
    ],
)
def test_wrong_rows_are_refused_by_participant_and_trial(tmp_path, rows, values, message) -> None:
    rows = change(rows, lambda row: row["run"] == "run0" and row["trial_index"] == 0, **values)
    with pytest.raises(InputError, match=message):
        analyse(tmp_path, rows)


def test_repeated_rows_count_once_and_contradictions_are_refused(tmp_path, rows) -> None:
    analysis = analyse(tmp_path, [*rows, rows[0]])
    assert "1 repeated row of the same trials was counted once" in analysis.decisions
    with pytest.raises(InputError, match="participant P00, trial 0 occurs twice"):
        analyse(
            tmp_path, [*rows, rows[0] | {"response": 8 - int(rows[0]["response"])}, rows[0] | {"response": 1}]
        )


def test_other_studies_and_experiments_are_distinguished(tmp_path, rows) -> None:
    two = rows + change(rows, lambda row: True, study="t", run="z")
    path = write_export(tmp_path / "two.csv", EXP3, two)
    with pytest.raises(InputError, match="holds 2 studies; choose one with --study: s, t"):
        load_csv(path, EXP3, READING)
    ratings = load_csv(path, EXP3, READING, "s")
    assert len(ratings.rows) == len(rows)
    assert "were ignored" in ratings.decisions[0]
    other = write_export(tmp_path / "o.csv", EXP3, change(rows, lambda row: True, experiment="exp1"))
    with pytest.raises(InputError, match="holds experiment exp1, not 'exp3'"):
        load_csv(other, EXP3, READING)


def test_nothing_to_analyse_is_distinguished_from_bad_input(tmp_path, rows) -> None:
    with pytest.raises(NoRatingsError, match="no ratings yet"):
        load_csv(write_export(tmp_path / "e.csv", EXP3, []), EXP3, READING)
    with pytest.raises(NoRatingsError, match="no ratings of origin 'participant'"):
        analyse(tmp_path, rows, pool=Pool(Origin.PARTICIPANT))
    with pytest.raises(NoRatingsError, match="no participant remains"):
        analyse(tmp_path, change(rows, lambda row: True, run_status="withdrawn"))
    gone = change(rows, lambda row: True, run_status="withdrawn", run_origin="participant")
    made = [row | {"run": f"{row['run']}-s", "run_origin": "simulated"} for row in rows]
    with pytest.raises(NoRatingsError, match=r"answers of other origins: --origin simulated$"):
        analyse(tmp_path, [*gone, *made])
    with pytest.raises(NoRatingsError, match="there is no database"):
        load_database(f"sqlite:///{tmp_path}/none.sqlite", EXP3, READING)
    empty = make_database(tmp_path / "x.sqlite", EXP3, np.full((2, 4, 1), 3), participants=["a", "b"])
    with pytest.raises(NoRatingsError, match="experiment 'exp1' has no ratings yet"):
        load_database(empty, load_experiment("exp1"), READING)


@pytest.mark.parametrize("url", ["nonsense", "mysterysql://x/y"])
def test_an_unusable_database_address_is_refused(url) -> None:
    with pytest.raises(InputError, match="is not a database URL"):
        load_database(url, EXP3, READING)


def test_a_file_that_is_not_a_database_is_refused(tmp_path) -> None:
    (tmp_path / "f.sqlite").write_text("not a database, but a rather long text that SQLite cannot read")
    with pytest.raises(InputError, match=r"cannot read f\.sqlite"):
        load_database(f"sqlite:///{tmp_path}/f.sqlite", EXP3, READING)


def two_groups(tmp_path, rows):
    text = locate("exp1").read_text(encoding="utf-8").replace('split_by = "character"\n', "")
    text = text.replace('name = "character"\nlabel', 'name = "character"\nbetween = true\nlabel')
    return analyse(tmp_path, rows, parse_experiment(text))


def exp1_rows() -> list[dict]:
    experiment = load_experiment("exp1")
    return rows_of(experiment, simulate(experiment, 8, trials=1))


def test_a_factor_between_participants_is_tested_between_them(tmp_path) -> None:
    group = ("photorealistic", "cartoon")
    kept = [row for row in exp1_rows() if row["character"] == group[int(str(row["participant"])[1:]) % 2]]
    result = two_groups(tmp_path, kept)
    assert (result.anova.between.factors, result.anova.n_participants) == (("character",), 8)
    means = {
        (row["character"], row["participant"]): np.mean(
            [r["response"] for r in kept if r["participant"] == row["participant"]]
        )
        for row in kept
    }
    sides = [[mean for (character, _), mean in means.items() if character == name] for name in group]
    t, p = stats.ttest_ind(*sides)
    effect = result.anova.effect("character")
    assert effect.univariate.f_value == pytest.approx(t**2)
    assert effect.univariate.p_value == pytest.approx(p)


def test_a_participant_of_two_groups_is_refused_by_name(tmp_path) -> None:
    with pytest.raises(InputError, match=r"participant P00 has ratings of .* declared between participants"):
        two_groups(tmp_path, exp1_rows())
