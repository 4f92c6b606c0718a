"""Commands for any table read the server's own export too: practice and excluded runs do not count."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.pairs.comparisons import read_comparisons
from analysis.read.column_roles import guess_roles
from analysis.read.long_csv import read_long_table
from analysis.read.model_csv import read_model_input
from analysis.thresholds.answers import read_answers
from analysis.votes import read_votes, read_votes_by
from experiments.errors import InputError

HEADER = "run,participant,run_status,trial_index,kind,profile_id,face,stimulus,response,verdict,excluded\n"


@pytest.fixture
def export(tmp_path: Path) -> Path:
    """Six main trials of three people, two practice trials, and a run that was excluded by hand."""
    lines = []
    for person in ("p1", "p2", "p3"):
        for number, face in enumerate(("a", "b")):
            excluded = int(person == "p3")
            lines.append(f"r{person},{person},complete,{number},main,x,{face},{number + 1},1,good,{excluded}")
    lines += [f"rp1,p1,complete,{number},practice,x,a,1,0,good,0" for number in (7, 8)]
    file = tmp_path / "export.csv"
    file.write_text(HEADER + "\n".join(lines) + "\n", encoding="utf-8")
    return file


def said(decisions: tuple[str, ...]) -> str:
    return " ".join(decisions)


def test_anova_and_ranks(export: Path) -> None:
    data = read_long_table(export, "participant", "response", ["face"])
    assert len(data.rows) == 4
    assert set(data.rows["participant"]) == {"p1", "p2"}
    assert "practice" in said(data.decisions)
    assert "rows were counted" not in said(data.decisions), "practice rows are not a second row of a cell"


@pytest.mark.parametrize("words", [("1.0", "0.0"), ("TRUE", "FALSE")])
def test_flags_as_other_programs_write_them(export: Path, words: tuple[str, str]) -> None:
    """pandas writes 0 and 1 as 0.0 and 1.0 where a cell of the column is empty, R as FALSE and TRUE."""
    out, kept = words
    lines = export.read_text().splitlines()
    ends = {"1": out, "0": kept}
    changed = [lines[0], *(f"{line[:-1]}{ends[line[-1]]}" for line in lines[1:])]
    export.write_text("\n".join(changed), encoding="utf-8")
    assert set(read_long_table(export, "participant", "response", ["face"]).rows["participant"]) == {
        "p1",
        "p2",
    }
    model = read_model_input(export, "participant", "response", ["face"], [])
    assert set(model.rows["participant"]) == {"p1", "p2"}


def test_a_flag_that_says_neither_is_refused(export: Path) -> None:
    export.write_text(export.read_text().replace("good,1", "good,WAHR"), encoding="utf-8")
    with pytest.raises(InputError, match="'excluded' is 'WAHR' in a row; expected 0 or 1"):
        read_long_table(export, "participant", "response", ["face"])


def test_two_runs_of_one_participant_are_said(export: Path) -> None:
    assert "more than once" not in said(
        read_long_table(export, "participant", "response", ["face"]).decisions
    )
    export.write_text(export.read_text().replace("rp2,p2", "rp2,p1"), encoding="utf-8")
    expected = "1 participant took part more than once (p1), and the answers of all runs were counted"
    readings = (
        read_long_table(export, "participant", "response", ["face"]),
        read_model_input(export, "participant", "response", ["face"], []),
        read_votes(export, "stimulus", "participant", "response"),
    )
    for reading in readings:
        assert expected in said(reading.decisions)


def test_opinion_and_agreement(export: Path) -> None:
    votes = read_votes(export, "stimulus", "participant", "response")
    assert votes.people == ("p1", "p2")
    assert np.nansum(votes.counts) == 4
    assert "practice" in said(votes.decisions)


def test_thresholds(export: Path) -> None:
    answers = read_answers(export, "stimulus", "response", participant="participant")
    assert len(answers.x) == 4
    assert "practice" in said(answers.decisions)


def test_table_of_someone_else_with_a_column_kind_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "mine.csv"
    file.write_text("id,kind,score\n" + "".join(f"p{n},k{n % 2},{n}\n" for n in range(6)), encoding="utf-8")
    assert len(read_long_table(file, "id", "score", ["kind"]).rows) == 6


ANSWERED = "rp1,p1,complete,9,attention,,,,1,good,0\n"
"""An instructed answer: it has no clip, and so no level of any factor."""


def test_checks_without_a_clip_stop_no_command(export: Path) -> None:
    before = export.read_text(encoding="utf-8")
    export.write_text(before + ANSWERED, encoding="utf-8")
    data = read_long_table(export, "participant", "response", ["face"])
    assert len(data.rows) == 4
    assert sorted(data.rows["face"].cat.remove_unused_categories().cat.categories) == ["a", "b"]
    assert len(read_model_input(export, "participant", "response", ["face"], ["stimulus"]).rows) == 4
    assert read_votes(export, "stimulus", "participant", "response").items == ("1", "2")
    assert len(read_answers(export, "stimulus", "response", by="face").x) == 4


def test_an_empty_level_of_a_row_that_counts_is_refused(export: Path) -> None:
    export.write_text(
        export.read_text(encoding="utf-8") + ANSWERED.replace("attention", "main"), encoding="utf-8"
    )
    with pytest.raises(InputError, match="'face' is empty in line 10; every row needs one"):
        read_long_table(export, "participant", "response", ["face"])


def test_checks_without_a_clip_do_not_stop_comparisons(tmp_path: Path) -> None:
    file = tmp_path / "pairs.csv"
    file.write_text(
        "kind,left_cell,right_cell,winner\nmain,a,b,left\nmain,b,a,left\nattention,,,right\n",
        encoding="utf-8",
    )
    assert read_comparisons(file, "left_cell", "right_cell", "winner").items == ("a", "b")


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("scale", ("calm", "eerie"), r"expected answers on one scale, got 2 \(calm, eerie\); keep the rows"),
        ("data_series", ("1", "2"), r"of one data series, got 2 \(1, 2\); export one with .* --series N"),
        (
            "run_origin",
            ("participant", "simulated"),
            r"of one origin, got 2 \(participant, simulated\); export",
        ),
    ],
)
def test_answers_that_have_no_common_mean_are_not_pooled(
    export: Path, column: str, values: tuple[str, str], message: str
) -> None:
    """Sliders from 0 to 100 and points from 1 to 7 had one mean; so had two data series."""
    header, *rows = export.read_text(encoding="utf-8").splitlines()
    lines = [f"{header},{column}", *(f"{row},{value}" for row in rows for value in values)]
    export.write_text("\n".join(lines) + "\n", encoding="utf-8")
    readers: tuple[Callable[[], object], ...] = (
        lambda: read_long_table(export, "participant", "response", ["face"]),
        lambda: read_model_input(export, "participant", "response", ["face"], []),
        lambda: read_votes(export, "stimulus", "participant", "response"),
        lambda: read_answers(export, "stimulus", "response"),
    )
    for read in readers:
        with pytest.raises(InputError, match=message):
            read()
    by = read_votes_by(export, ("stimulus", "participant", "response"), column)
    assert set(by) == set(values)
    assert len(read_long_table(export, "participant", "response", ["face", column]).rows) == 8


def test_a_pilot_may_be_pooled_with_the_study(export: Path) -> None:
    header, *rows = export.read_text(encoding="utf-8").splitlines()
    origins = ("pilot", "participant")
    lines = [f"{header},run_origin", *(f"{row},{origins[n % 2]}" for n, row in enumerate(rows))]
    export.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert len(read_long_table(export, "participant", "response", ["face"]).rows) == 4


def test_series_are_pooled_on_purpose_without_their_column(export: Path) -> None:
    """The guide to changing a running study says how, and so does the message."""
    header, *rows = export.read_text(encoding="utf-8").splitlines()
    lines = [f"{header},data_series", *(f"{row},{1 + n % 2}" for n, row in enumerate(rows))]
    export.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="to pool them on purpose, remove the column data_series"):
        read_long_table(export, "participant", "response", ["face"])
    export.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    assert len(read_long_table(export, "participant", "response", ["face"]).rows) == 4


@pytest.mark.parametrize(("scales", "is_refused"), [(("calm", "eerie"), True), (("calm", "calm"), False)])
def test_proposed_command_is_announced_where_it_refuses_the_table(
    export: Path, scales: tuple[str, str], is_refused: bool
) -> None:
    header, *rows = export.read_text(encoding="utf-8").splitlines()
    lines = [f"{header},definition_sha256,scale", *(f"{row},0,{scales[n % 2]}" for n, row in enumerate(rows))]
    export.write_text("\n".join(lines) + "\n", encoding="utf-8")
    guess = guess_roles(export)
    assert guess.command == "anova"
    said = "the command below refuses this table as it is: expected answers on one scale, got 2 (calm, eerie)"
    assert any(said in line for line in guess.decisions) == is_refused
