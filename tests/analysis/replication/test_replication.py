"""Published studies: every shipped one to its printed digits, a new one as one folder, bad declarations."""

import hashlib
from functools import partial
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from analysis.cli import app
from analysis.replication import (
    FILE_OPTIONS,
    SHIPPED,
    TABLE_COMMANDS,
    TABLE_MAKERS,
    load_study,
    number_at,
    replicate_study,
    shipped_studies,
)
from experiments.errors import InputError

run = partial(app, standalone_mode=False)

STUDY = """
title = "A study"
source = "https://example.org"
license = "CC0"

[files]
"ratings.csv" = "{sha}"

[[analysis]]
name = "Scores of {{group}}"
table = "ratings.csv"
where = "group == '{{group}}' and score < 9"
columns = {{ doubled = "score * 2" }}
join = {{ person = "{{group}}-{{id}}" }}
run = ["t-test", "--participant", "person", "--rating", "doubled", "--against", "1"]
form = "M = {{groups[0].mean:2}}, t({{tests[0].df}}) = {{tests[0].t}}, p {{tests[0].p_value}}"
cases = [{{ group = "a", printed = "{printed}" }}]
"""
CSV = "id,group,score\n1,a,2\n2,a,3\n3,a,4\n4,a,9\n5,b,1\n"
PRINTED = "M = 6, t(2) = 4.33, p = .049"


def _folder(path: Path, text: str = STUDY, printed: str = PRINTED) -> Path:
    path.mkdir(exist_ok=True)
    sha = hashlib.sha256(CSV.encode()).hexdigest()
    (path / "study.toml").write_text(text.format(sha=sha, printed=printed), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_studies_are_rebuilt_to_the_printed_digits(name: str) -> None:
    result = replicate_study(run, name)
    if name == "p1203-acr":
        assert "non-commercial" in result.missing
        assert not result.rows
        return
    assert not result.missing
    assert not result.unexplained, result.unexplained[:3]
    assert len(result.rows) >= 10
    assert result.study.synthetic == name.startswith("paper-")


def test_bootstrap_limits_are_those_printed_within_simulation_error() -> None:
    result = replicate_study(run, "hdr-vdc-pairs", slow=True)
    limits = [row for row in result.rows if row.analysis.startswith("Bootstrap")]
    assert len(limits) == 928
    assert all(row.equal for row in limits)


def test_a_study_that_may_not_be_shipped_takes_the_users_copy(shared_data: Path) -> None:
    result = replicate_study(run, "p1203-acr", shared_data / "published" / "p1203-acr")
    assert (len(result.rows), result.n_equal) == (956, 956)


def test_what_is_shipped_is_small_licensed_and_without_persons() -> None:
    files = [path for path in SHIPPED.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= 2_000_000
    assert shipped_studies()[:3] == ["paper-exp1", "paper-exp2", "paper-exp3"]
    for name in shipped_studies():
        folder, study = load_study(name)
        raw = [path for path in folder.iterdir() if path.suffix in (".csv", ".json", ".gz")]
        assert not raw or (folder / "LICENSE").is_file() or "CC BY" in study.license
        for path in folder.glob("*.csv"):
            header = path.read_text(encoding="utf-8").splitlines()[0].lower().split(",")
            assert not {"age", "sex", "gender", "name"} & set(header)


def test_a_new_study_is_one_folder(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "ours")
    runner = CliRunner()
    ended = runner.invoke(app, ["replicate", str(folder)])
    assert ended.exit_code == 0, ended.output
    assert "not shipped" in ended.output
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "ratings.csv").write_text(CSV, encoding="utf-8")
    out = tmp_path / "out"
    ended = runner.invoke(app, ["replicate", str(folder), "--data", str(copy), "--out", str(out)])
    assert ended.exit_code == 0, ended.output
    assert "A study        4      4       0" in ended.output
    assert len((out / "comparison.csv").read_text(encoding="utf-8").splitlines()) == 5
    (folder / "ratings.csv").write_text(CSV, encoding="utf-8")
    _folder(folder, printed=PRINTED.replace("4.33", "4.34"))
    ended = runner.invoke(app, ["replicate", str(folder)])
    assert ended.exit_code == 1
    assert "printed 4.34, ours 4.33013: study.toml gives no" in ended.output
    more = '\n[[not_reproduced]]\nfigure = "t$"\nreason = "a misprint"\n'
    _folder(folder, STUDY + more, PRINTED.replace("4.33", "4.34"))
    assert not replicate_study(run, str(folder)).unexplained
    # a number that is equal although a difference was declared is a wrong declaration
    _folder(folder, STUDY + more)
    assert len(replicate_study(run, str(folder)).unexplained) == 1


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (
            "score * 2",
            "__import__('os')",
            "only columns, numbers, texts, arithmetic and comparisons are allowed",
        ),
        ("score * 2", "scores * 2", "name 'scores' is not defined"),
        ("tests[0].t}", "tests[3].t}", "the analysis has no number at 'tests[3].t'; look at its --json"),
        ("M = {{groups", "mean {{groups", "does not have the form"),
        ("t-test", "t-tests", "reliability, agreement, got 't-tests'"),
        ('"t-test"', '"run"', "expected one of anova, ranks, t-test"),
        ('"--against", "1"', '"--against", "1", "--json=/tmp/x"', "a study may not choose files"),
        (
            'table = "ratings.csv"',
            'made_by = ["convert", "a.csv"]',
            "expected one of synthesise, got 'convert'",
        ),
        ('title = "A study"', "titel = 1", "study.toml: title: Field required"),
        ('"doubled", "--against"', '"tripled", "--against"', "ratings.csv has no column 'tripled'"),
        ("{{group}}-{{id}}", "{{group}}-{{ids}}", "expected {columns} of the table, got 'ids'"),
        ("{sha}", "{sha:.63}0", "the file again from the source"),
    ],
)
def test_wrong_declarations_are_one_line(tmp_path: Path, before: str, after: str, said: str) -> None:
    assert before in STUDY
    folder = _folder(tmp_path / "ours", STUDY.replace(before, after))
    (folder / "ratings.csv").write_text(CSV, encoding="utf-8")
    with pytest.raises(InputError) as error:
        replicate_study(run, str(folder))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("printed", "n_equal"), [("5e-02", 4), ("4.9e-02", 4), ("6e-02", 3), ("4e-01", 3)])
def test_a_power_of_ten_has_its_own_last_digit(tmp_path: Path, printed: str, n_equal: int) -> None:
    folder = _folder(tmp_path / "ours", printed=PRINTED.replace(".049", printed))
    (folder / "ratings.csv").write_text(CSV, encoding="utf-8")
    assert replicate_study(run, str(folder)).n_equal == n_equal


def test_files_may_be_in_a_folder_of_the_study(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "ours", STUDY.replace("ratings.csv", "raw/ratings.csv"))
    (folder / "raw").mkdir()
    (folder / "raw" / "ratings.csv").write_text(CSV, encoding="utf-8")
    assert replicate_study(run, str(folder)).n_equal == 4


def test_no_option_of_an_allowed_command_names_another_file() -> None:
    commands = typer.main.get_group(app).commands
    assert set(commands) >= {*TABLE_COMMANDS, *TABLE_MAKERS}
    for name in (*TABLE_COMMANDS, *TABLE_MAKERS):
        for parameter in commands[name].params:
            # A private attribute of typer's: without it, this test fails and needs another instrument.
            kind = parameter.type_descriptor.annotation  # type: ignore[attr-defined]
            if kind is Path and parameter.param_type_name == "option":
                assert {*parameter.opts} <= {*FILE_OPTIONS}, (name, parameter.opts)


def test_addresses_reach_numbers() -> None:
    numbers = {"a": [{"n": "x - y", "v": 2.0}, {"n": "b", "v": {"c": 3}}], "d e": {"f.g": 4}}
    assert number_at(numbers, "a[n=x - y].v - a[n=b].v.c * 2") == -2.0
    assert number_at(numbers, "a[1].v[c] / 2") == 1.5
    with pytest.raises(InputError, match="there is no study 'nothing', and no folder"):
        load_study("nothing")
