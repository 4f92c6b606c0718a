"""The commands as a person calls them: outputs, exit codes, one line for what is wrong."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.paper.printed import SHIPPED
from experiments.command_line import run_command_line
from experiments.errors import InputError
from experiments.load import load_experiment, locate, parse_experiment
from experiments.schema.canonical import definition_sha256
from tests.analysis.ratings_file import rows_of, simulate, write_export
from tests.analysis.study_database import make_database
from tests.helpers.golden_databases import golden_file

EXP3 = load_experiment("exp3")
LONG = "id,y,face,blur\n" + "".join(
    f"{p},{(p * 3 + f * 2 + b * p) % 7 + 1},f{f},b{b}\n" for p in range(8) for f in range(3) for b in range(2)
)


def call(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def export(tmp_path):
    return write_export(tmp_path / "r.csv", EXP3, rows_of(EXP3, simulate(EXP3, 8)))


def test_run_prints_the_tables_and_writes_the_json(export, tmp_path) -> None:
    result = call("run", "exp3", "--csv", export, "--no-report", "--json", tmp_path / "a.json")
    assert result.exit_code == 0, result.output
    assert "Lower-lid" in result.stdout
    assert "SYNTHETIC DATA" in result.stdout
    assert max(map(len, result.stdout.replace(str(tmp_path), "").splitlines())) <= 80
    assert json.loads((tmp_path / "a.json").read_text())["exclusions"]["n_runs"] == 8


def test_run_writes_the_report_with_its_sensitivity_analyses(export, tmp_path) -> None:
    result = call("run", "exp3", "--csv", export, "--out", tmp_path / "new" / "folder")
    assert result.exit_code == 0, result.output
    report = (tmp_path / "new" / "folder" / "report.md").read_text()
    for title in ("Bayes factors", "Linear mixed model", "Ordinal mixed model"):
        assert f"## {title}" in report
    assert "Not fitted" not in report


def test_run_finds_the_default_database(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("DATABASE_URL", raising=False)
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(tmp_path))
    empty = call("run", "exp3", "--no-report")
    assert empty.exit_code == 1
    assert "nothing to analyze: there is no database" in empty.stderr
    assert "set PALPEBRA_DATA_FOLDER to" in " ".join(empty.stderr.split())
    make_database(tmp_path / "palpebra.sqlite", EXP3, simulate(EXP3, 6), participants=list("abcdef"))
    found = call("run", "exp3", "--no-report")
    assert found.exit_code == 0
    assert "6 participants, from palpebra.sqlite" in found.stdout
    other = call("run", "exp1", "--no-report")
    assert other.exit_code == 1
    assert "'exp1' has no ratings yet" in other.stderr
    elsewhere = call("run", "exp3", "--no-report", "--study", "foo")
    assert elsewhere.exit_code == 1
    assert "no ratings of experiment 'exp3' in a study 'foo'" in elsewhere.stderr


def test_an_option_given_twice_is_refused(tmp_path) -> None:
    """Only the last one would count: another design than the one that was asked for."""
    (tmp_path / "t.csv").write_text(LONG)
    command = ("anova", tmp_path / "t.csv", "--participant", "id", "--rating", "y")
    twice = call(*command, "--within", "face", "--within", "blur")
    assert twice.exit_code == 2
    assert (
        "--within is given 2 times; give it once. Separate several by commas: --within a,b." in twice.stderr
    )
    repeatable = ("--levels", "face=f2,f1,f0", "--levels", "blur=b0,b1")
    assert call(*command, "--within", "face,blur", *repeatable).exit_code == 0


def test_anova_reports_the_univariate_test_first_where_asked(tmp_path) -> None:
    (tmp_path / "t.csv").write_text(LONG)
    command = ("anova", tmp_path / "t.csv", "--participant", "id", "--rating", "y", "--within", "face")
    default, asked = call(*command), call(*command, "--statistic", "univariate", "--out", tmp_path / "out")
    assert asked.exit_code == 0, asked.output
    [effect] = json.loads((tmp_path / "out" / "results.json").read_text())["effects"]
    found = effect["univariate"]
    assert "2, 6" in table_row(default.stdout, "face")
    assert f"{found['df_effect_gg']:.2f}, {found['df_error_gg']:.2f}" in table_row(asked.stdout, "face")
    assert (tmp_path / "out" / "report.docx").is_file()
    assert "univariate, df and p with the Greenhouse-Geisser correction" in asked.stdout


def table_row(text: str, name: str) -> str:
    """The first row that begins with `name`."""
    return next(line for line in text.splitlines() if line.startswith(f"{name} "))


def test_run_of_an_empty_export_exits_1(tmp_path) -> None:
    result = call("run", "exp3", "--csv", write_export(tmp_path / "e.csv", EXP3, []))
    assert result.exit_code == 1
    assert "has a header but no ratings yet" in result.stderr


def _store_exp3_as(name: str, file: Path) -> None:
    make_database(file, EXP3, simulate(EXP3, 6), participants=list("abcdef"))
    with closing(sqlite3.connect(file)) as database, database:
        database.execute(
            "UPDATE study_versions SET definition_toml = ?", (locate("exp3").read_text("utf-8"),)
        )
        database.execute("UPDATE studies SET name = ?", (name,))


def test_a_study_in_the_database_is_analysed_by_its_name(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("DATABASE_URL", raising=False)
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(tmp_path))
    _store_exp3_as("motion", tmp_path / "palpebra.sqlite")
    found = call("run", "motion", "--no-report")
    assert found.exit_code == 0, found.output
    assert "6 participants, from palpebra.sqlite" in found.stdout
    assert found.stdout == call("run", "exp3", "--no-report").stdout
    with pytest.raises(
        InputError, match=r"study 'motion' has no version 2; it has 1 version in 1 data series"
    ):
        call_raising("run", "motion", "--version", "2")
    with closing(sqlite3.connect(tmp_path / "palpebra.sqlite")) as database, database:
        row = "study_id, 2, experiment, definition_toml, definition, 'x', manifest, note, created_at, 2"
        names = "study_id, number, experiment, definition_toml, definition, definition_sha256, manifest, note"
        database.execute(
            f"INSERT INTO study_versions ({names}, created_at, series) SELECT {row} FROM study_versions"
        )
    with pytest.raises(InputError, match=r"has 2 data series.*choose one with --series 1 or --series 2"):
        call_raising("run", "motion")
    assert call("run", "motion", "--no-report", "--series", "1").exit_code == 0
    with pytest.raises(InputError, match=r"has no version 1 in data series 2; it has 2 versions"):
        call_raising("run", "motion", "--version", "1", "--series", "2")


def test_a_database_without_connection_is_named_for_a_study_too() -> None:
    words = r"'motion' is not a shipped experiment, and studies .* cannot read database lab on 127\.0\.0\.1"
    with pytest.raises(InputError, match=words):
        call_raising("run", "motion", "--database", "postgresql://me@127.0.0.1:1/lab")


def test_a_database_whose_studies_cannot_be_read_is_named_with_the_cause(tmp_path) -> None:
    file = tmp_path / "older.sqlite"
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("CREATE TABLE studies (id INTEGER, name TEXT)")
    words = "studies cannot be looked up: cannot read older.sqlite: no such table: study_versions"
    with pytest.raises(InputError, match=words) as raised:
        call_raising("run", "motion", "--database", f"sqlite:///{file}")
    assert "\n" not in str(raised.value)


def test_a_database_of_an_older_version_is_named_with_what_to_do(tmp_path) -> None:
    """That of 0.1.0 has the view of ratings with fewer columns."""
    file = tmp_path / "older.sqlite"
    file.write_bytes(golden_file("0001.sqlite"))
    words = r"cannot read older\.sqlite: no such column: \w+; if it is of an older version, `server database"
    with pytest.raises(InputError, match=words):
        call_raising("run", "exp1", "--database", f"sqlite:///{file}")


def call_raising(*arguments: str) -> None:
    CliRunner().invoke(app, arguments, catch_exceptions=False)


def test_an_unknown_study_is_refused_with_what_to_download(monkeypatch, capsys, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["analysis", "run", "motion"])
    monkeypatch.delenv("DATABASE_URL", raising=False)
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(tmp_path / "elsewhere"))
    with pytest.raises(SystemExit) as end:
        run_command_line(app)
    assert end.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith("error: no experiment 'motion'")
    words = " ".join(told.split())
    missing = f"There is no database at {tmp_path}/elsewhere/palpebra.sqlite to look for a study in"
    assert f"or the path of a TOML file. {missing}; set PALPEBRA_DATA_FOLDER to the" in words
    assert "its Design tab that downloads the definition (motion.toml), and give the path of" in words
    assert words.endswith("With the CSV from its Data tab: analysis run motion.toml --csv FILE")


def test_an_edited_shipped_study_is_analysed_by_its_own_definition(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("DATABASE_URL", raising=False)
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(tmp_path))
    file = tmp_path / "palpebra.sqlite"
    _store_exp3_as("exp3", file)
    before = call("run", "exp3", "--no-report")
    assert (before.exit_code, before.stderr) == (0, "")
    text = locate("exp3").read_text("utf-8")
    label = EXP3.factors[0].label
    assert text.count(f'label = "{label}"') == 1
    edited = text.replace(f'label = "{label}"', 'label = "Cover of the lid"')
    with closing(sqlite3.connect(file)) as database, database:
        values = (edited, definition_sha256(parse_experiment(edited)))
        database.execute("UPDATE study_versions SET definition_toml = ?, definition_sha256 = ?", values)
    after = call("run", "exp3", "--no-report")
    assert after.exit_code == 0, after.output
    said = "Study 'exp3' was edited: its own definition (version 1) is used, not the shipped exp3."
    assert said in " ".join(after.stderr.split())
    assert "Cover of the lid" in after.stdout
    assert label not in after.stdout
    assert "under a different declaration" not in " ".join(after.stdout.split())
    # A file that is named is used as it is, and the report says that the data had another.
    named = call("run", str(locate("exp3")), "--no-report")
    assert "under a different declaration" in " ".join(named.stdout.split())
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("UPDATE study_versions SET definition_toml = ''")
    with pytest.raises(InputError, match="give its TOML file instead"):
        call_raising("run", "exp3")


def test_a_study_of_the_database_comes_before_a_file_of_its_name(tmp_path, monkeypatch) -> None:
    """A name mistyped is answered with the database's own names."""
    monkeypatch.delenv("DATABASE_URL", raising=False)
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lids.toml").write_text("no definition")
    with pytest.raises(
        InputError,
        match=r"^no experiment 'lids'; there is a file lids.toml here; to use it: analysis run lids.toml$",
    ):
        call_raising("run", "lids")
    _store_exp3_as("lids", tmp_path / "palpebra.sqlite")
    found = call("run", "lids", "--no-report")
    assert found.exit_code == 0, found.output
    with pytest.raises(
        InputError,
        match=r"^no experiment or study 'lid'; did you mean 'lids'\? Studies in palpebra.sqlite: lids$",
    ):
        call_raising("run", "lid")
    with pytest.raises(
        InputError, match=r"a TOML file\. Studies in palpebra.sqlite: lids\. For a study made"
    ):
        call_raising("run", "motion")


def test_a_seed_below_zero_is_a_usage_error() -> None:
    result = call("synthesise", "exp3", "--seed", "-1", "--out", "ratings.csv")
    assert result.exit_code == 2
    assert "--seed" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "exp4"), "did you mean"),
        (("run", "exp3", "--csv", "nowhere.csv"), "no file nowhere.csv"),
        (("run", "exp3", "--csv", "a.csv", "--database", "sqlite:///b"), "cannot be combined; use"),
        (("run", "exp3", "--database", "what"), "is not a database URL"),
        (("check-paper", "nowhere.toml"), "no file"),
        (("anova", "nowhere.csv", "--participant", "a", "--rating", "b", "--within", "c"), "no file"),
        (("anova", "x.csv", "--participant", "a", "--rating", "b", "--within", ","), "no factor is named"),
        (
            ("anova", "x.csv", "--participant", "a", "--rating", "b", "--within", "c", "--scale", "7"),
            "like 1:7",
        ),
    ],
)
def test_wrong_calls_end_in_one_line_and_exit_2(arguments, message, capsys) -> None:
    result = call(*arguments)
    assert isinstance(result.exception, InputError)

    def again(**_: object) -> None:
        raise result.exception

    with pytest.raises(SystemExit) as caught:
        run_command_line(again)
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert message in said


def test_anova_of_anyones_table(tmp_path) -> None:
    (tmp_path / "t.csv").write_text(LONG + "8,3,f0,b0\n")
    columns = ("--participant", "id", "--rating", "y", "--within", "blur,face")
    result = call("anova", tmp_path / "t.csv", *columns, "--json", tmp_path / "o.json", "--two-factor-pairs")
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "o.json").read_text())
    assert [effect["effect"] for effect in data["effects"]] == ["blur", "face", "blur:face"]
    assert data["n_participants"] == 8
    assert data["dropped"][0]["participant"] == "8"
    assert len(data["dropped"][0]["missing_cells"]) == 5
    assert {pair["effect"] for pair in data["pairwise"]} == {"blur", "face", "blur:face"}
    assert len(data["marginal_means"]) == 2 + 3 + 6
    assert "participant 8 excluded" in result.stdout


@pytest.mark.parametrize(
    ("text", "within", "message"),
    [
        ("id,y,face\n1,2,a\n1,3,b\n", "face", "at least 2 complete participants, got 1"),
        ("id,y,face\n1,2,a\n1,4,a\n2,3,a\n", "face", "at least 2 levels of 'face', got 1"),
        ("id,y,face\n1,2,a\n2,3,b\n", "fase", "did you mean 'face'"),
    ],
)
def test_tables_without_a_test_are_refused(tmp_path, text, within, message) -> None:
    (tmp_path / "t.csv").write_text(text)
    out = tmp_path / "o.json"
    result = call(
        "anova", tmp_path / "t.csv", "--participant", "id", "--rating", "y", "--within", within, "--json", out
    )
    assert message in str(result.exception)
    assert not out.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "exp3", "--csv", "nowhere.csv"),
        ("anova", "nowhere.csv", "--participant", "a", "--rating", "b", "--within", "c"),
        ("pairs", "nowhere.csv"),
        ("thresholds", "nowhere.csv"),
        ("opinion", "nowhere.csv"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_place_for_numbers_that_cannot_be_is_refused_before_the_data_are_read(tmp_path, arguments) -> None:
    (tmp_path / "file").write_text("")
    result = call(*arguments, "--json", tmp_path / "file" / "o.json")
    assert "expected a folder" in str(result.exception)


def test_a_folder_that_cannot_hold_the_output_is_refused(tmp_path) -> None:
    (tmp_path / "t.csv").write_text(LONG)
    columns = ("--participant", "id", "--rating", "y", "--within", "face")
    result = call("anova", tmp_path / "t.csv", *columns, "--json", tmp_path / "t.csv" / "o.json")
    assert "expected a folder" in str(result.exception)
    result = call("anova", tmp_path / "t.csv", *columns, "--out", tmp_path / "t.csv")
    assert "expected a folder" in str(result.exception)


def test_constant_ratings_are_analysed_with_reasons(tmp_path) -> None:
    (tmp_path / "t.csv").write_text("id,y,f\n1,4,a\n1,4,b\n2,4,a\n2,4,b\n")
    result = call("anova", tmp_path / "t.csv", "--participant", "id", "--rating", "y", "--within", "f")
    assert result.exit_code == 0, result.output
    assert "nothing varies" in " ".join(result.stdout.split())
    assert "gave the same rating" in " ".join(result.stdout.split())


def test_check_paper_ships_with_the_papers_figures(tmp_path) -> None:
    result = call("check-paper", "--json", tmp_path / "f.json")
    assert result.exit_code == 0, result.output
    assert "6 problems and 8 notes" in result.stdout
    assert len(json.loads((tmp_path / "f.json").read_text())) == 14
    assert call("check-paper", SHIPPED).exit_code == 1, "six printed figures of a file do not fit"


@pytest.mark.parametrize(
    "arguments",
    [
        ("anova", "--participant", "id", "--rating", "y", "--within", "f"),
        ("opinion", "--item", "f", "--participant", "id", "--rating", "y"),
        ("mixed", "--participant", "id", "--rating", "y", "--within", "f"),
        ("thresholds", "--x", "y", "--response", "yes"),
        ("pairs", "--left", "f", "--right", "g", "--winner", "yes"),
        ("reliability", "--items", "y,z"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_the_numbers_are_written_though_the_reader_of_the_tables_has_gone(
    tmp_path, monkeypatch, arguments
) -> None:
    """`analysis anova ... --json out.json | head` closes the pipe."""

    def gone(*_: object, **__: object) -> None:
        raise BrokenPipeError

    rows = [
        f"{i},{1 + (5 * i + 3 * j + 2 * k * k) % 7},{1 + (3 * i + j + k) % 5},{'ab'[j]},{'ba'[j]},"
        f"{'left' if 1 + (5 * i + 3 * j + 2 * k * k) % 7 + k > 4 else 'right'}"
        for i in range(6)
        for j in range(2)
        for k in range(3)
    ]
    text = "\n".join(["id,y,z,f,g,yes", *rows])
    if arguments[0] == "thresholds":
        text = text.replace("left", "1").replace("right", "0")
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    monkeypatch.setattr("typer.echo", gone)
    result = call(arguments[0], tmp_path / "a.csv", *arguments[1:], "--json", tmp_path / "a.json")
    assert isinstance(result.exception, BrokenPipeError | SystemExit), result.exception
    assert json.loads((tmp_path / "a.json").read_text())
