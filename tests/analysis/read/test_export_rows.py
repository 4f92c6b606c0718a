"""Commands for any table read the server's own export too: practice and excluded runs do not count."""

from pathlib import Path

import numpy as np
import pytest

from analysis.read.long_csv import read_long_table
from analysis.read.model_csv import read_model_input
from analysis.thresholds.answers import read_answers
from analysis.votes import read_votes
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
