"""Guesses of what columns are, on tables of strangers, and the options that roles become."""

import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.read.column_roles import TableGuess, guess_roles, options_of, said_of_values
from experiments.errors import InputError


def guess(folder: Path, text: str) -> TableGuess:
    file = folder / "table.csv"
    file.write_text(text, encoding="utf-8")
    return guess_roles(file)


def roles(found: TableGuess) -> dict[str, str]:
    return {one.name: one.role for one in found.columns if one.role}


def _long(header: str, rows: list[str]) -> str:
    return "\n".join([header, *rows, ""])


def test_pairs_are_recognized_by_their_columns(tmp_path: Path) -> None:
    rows = [f"o{n},s{n % 2},a,b,left" for n in range(6)]
    found = guess(tmp_path, _long("observer,scene,condition_1,condition_2,selection", rows))
    assert found.command == "pairs"
    assert found.command_line("t.csv") == (
        "analysis pairs t.csv --left=condition_1 --right=condition_2 --winner=selection "
        "--participant=observer --by=scene"
    )


@pytest.mark.parametrize("name", ["-1.csv", "my ratings.csv", "--help.csv"])
def test_the_command_reads_a_file_of_any_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [f"{n},{'ab'[k]},{400 + n * 7 % 5 + k * n % 3}" for n in range(8) for k in range(2)]
    line = guess(tmp_path, _long("person,side,rating", rows)).command_line(name)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "table.csv").rename(tmp_path / name)
    ended = CliRunner().invoke(app, shlex.split(line)[1:])
    assert ended.exit_code == 0, f"{line}: {ended.output}"


def test_groups_differ_from_factors_within(tmp_path: Path) -> None:
    rows = [
        f"{n},{'xz'[n % 2]},{18 + n},{c},{400.5 + n * 7 + k}" for n in range(8) for k, c in enumerate("ab")
    ]
    found = guess(tmp_path, _long("Subject,Alcohol,age,Cong,RT", rows))
    assert roles(found) == {
        "Subject": "participant",
        "Alcohol": "between",
        "age": "covariate",
        "Cong": "within",
        "RT": "rating",
    }
    assert found.command == "anova"


@pytest.mark.parametrize("time", ["2026-11-30T09:0{}:00Z", "2026-11-30", "30.11.2026 09:0{}", "9:0{} PM"])
def test_times_and_values_of_one_person_each_are_no_groups(time: str, tmp_path: Path) -> None:
    rows = [
        f"p{n},{time.format(n % 4)},2026-11-{n % 3 + 10},note {n % 7},{'xz'[n % 2]},{c},{400.5 + n * 7 + k}"
        for n in range(8)
        for k, c in enumerate("ab")
    ]
    header = "participant,started_at,completed_at,comment,hand,eye,rating"
    found = guess(tmp_path, _long(header, rows))
    expected = {"participant": "participant", "hand": "between", "eye": "within", "rating": "rating"}
    assert roles(found) == expected


def test_votes_on_many_clips_are_opinion_scores(tmp_path: Path) -> None:
    rows = [f"pvs{k},s{n},{1 + (n + k) % 5},0" for n in range(6) for k in range(30)]
    found = guess(tmp_path, _long("pvs_id,person,mos,repetition", rows))
    assert found.command == ""  # `pvs_id` says nothing
    found = guess(tmp_path, _long("clip,person,mos,repetition", rows))
    assert (
        found.command_line("t.csv") == "analysis opinion t.csv --item=clip --participant=person --rating=mos"
    )


def test_the_clips_of_a_factorial_design_are_items(tmp_path: Path) -> None:
    """`anova` averages over them, but a mixed model of the same table takes them."""
    rows = [
        f"p{n},{speed},{speed}{k}.mp4,{(n + k) % 7}" for n in range(9) for speed in "ab" for k in range(5)
    ]
    found = guess(tmp_path, _long("participant,speed,stimulus,response", rows))
    assert roles(found) == {
        "participant": "participant",
        "speed": "within",
        "stimulus": "item",
        "response": "rating",
    }
    assert "item" not in found.command_line("t.csv")


def test_levels_and_yes_or_no_are_thresholds(tmp_path: Path) -> None:
    rows = [f"v{n % 3},{10 * (n % 7)},{'yes' if n % 7 > 3 else 'no'},{'lr'[n % 2]}" for n in range(84)]
    found = guess(tmp_path, _long("id,duration_ms,seen,eye", rows))
    assert found.command == "thresholds"
    assert roles(found) == {"id": "participant", "duration_ms": "x", "seen": "response", "eye": "by"}


def test_a_wide_table_is_named(tmp_path: Path) -> None:
    rows = [f"{n},{n / 3},{n / 4},{n / 5},{n / 7}" for n in range(1, 9)]
    found = guess(tmp_path, _long("subject,near_NB,near_MB,far_NB,far_MB", rows))
    assert found.command == ""
    assert "the table looks wide" in found.decisions[-1]


def test_values_are_described(tmp_path: Path) -> None:
    rows = [f"{n},{n / 2 if n else 'NA'},{'ab'[n % 2]}," for n in range(9)]
    found = guess(tmp_path, _long("id,y,face,empty", rows))
    said = {one.name: (said_of_values(one), one.n_missing) for one in found.columns}
    assert said["y"] == ("8 numbers from 0.5 to 4", 1)
    assert said["face"] == ("2 texts: a, b", 0)
    assert said["empty"] == ("nothing", 9)


@pytest.mark.parametrize(
    ("command", "chosen", "said"),
    [
        ("ranks", {"p": "participant", "r": "rating", "a": "within", "b": "within"}, "one column for within"),
        ("anova", {"p": "participant", "r": "rating"}, "needs a factor"),
        ("anova", {"p": "participant", "r": "rating", "a,b": "within"}, "has a comma in its name"),
        ("pairs", {"l": "left", "w": "winner"}, "needs a column for right"),
        ("run", {}, "expected an analysis"),
        (
            "t-test",
            {"p": "participant", "r": "rating", "a": "within"},
            "t-test takes no column for 'within', got 'a'",
        ),
    ],
)
def test_roles_that_are_no_analysis_are_refused(command: str, chosen: dict[str, str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        options_of(command, chosen)
