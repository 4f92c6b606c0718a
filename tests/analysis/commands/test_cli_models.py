"""The commands mixed, ordinal, power and synthesise, as a person calls them."""

import json
import shutil
from pathlib import Path

import pytest

from analysis.cli import app
from experiments.command_line import run_command_line

GOLDEN = Path(__file__).parents[2] / "golden" / "r" / "models"


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["analysis", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            run_command_line(app)
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out, said.err

    return run


def test_synthesise_then_mixed_and_ordinal_read_the_export_as_is(call, tmp_path):
    code, out, _ = call("synthesise", "exp3", "--seed", 5, "--out", "ratings.csv", "--n", 10)
    assert code in (0, 1)
    assert "SYNTHETIC exp3" in out
    code, out, err = call("mixed", "ratings.csv", "--json", "mixed.json")
    assert (code, err) == (0, "")
    assert "SYNTHETIC DATA" in out
    assert max(map(len, out.splitlines())) <= 80
    found = json.loads((tmp_path / "mixed.json").read_text(encoding="utf-8"))
    assert found["synthetic"] is True
    assert [e["effect"] for e in found["effects"]] == ["lower_lid"]
    assert found["n_items"] == 20
    code, out, _ = call("mixed", "ratings.csv", "--df", "kenward-roger", "--intervals", "--json", "few.json")
    assert code == 0
    assert "Kenward and Roger's degrees of freedom" in " ".join(out.split())
    assert "profile likelihood" in out
    assert max(map(len, out.splitlines())) <= 80
    few = json.loads((tmp_path / "few.json").read_text(encoding="utf-8"))
    assert few["df_method"] == "kenward-roger"
    assert all(row["ci"][0] < row["estimate"] < row["ci"][1] for row in few["coefficients"])
    assert all(row["ci"] is None for row in found["coefficients"])
    code, out, _ = call("ordinal", "ratings.csv")
    assert code == 0
    assert "lower_lid" in out


def test_mixed_of_anyones_table(call):
    shutil.copy(GOLDEN / "mixed_two_by_two.csv", "table.csv")
    code, out, _ = call(
        "mixed", "table.csv", "--rating", "rating", "--within", "A,B", "--item", "clip", "--slopes", "main"
    )
    assert code == 0
    assert "A:B" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("mixed", "absent.csv"), "absent.csv"),
        (("mixed", "table.csv", "--rating", "rating"), "--within names no column"),
        (("mixed", "table.csv", "--rating", "rating", "--within", "A", "--item", "participant"), "as item"),
        (("mixed", "table.csv", "--rating", "ratings", "--within", "A"), "did you mean 'rating'"),
        (("ordinal", "table.csv", "--rating", "rating", "--within", "A,Q", "--item", "clip"), "'Q'"),
        (("synthesise", "exp3", "--out", "table.csv/folder.csv"), "expected a folder"),
        (("synthesise", "expp3"), "did you mean 'exp"),
        (("power", "exp1", "--n", "9:3"), "first <= last"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(call, arguments, said):
    shutil.copy(GOLDEN / "mixed_two_by_two.csv", "table.csv")
    code, _, err = call(*arguments)
    assert code == 2
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert said in err


def test_power_prints_a_table_and_draws_a_plot(call, tmp_path):
    code, out, err = call("power", "exp3", "--n", "10:20:10", "--simulations", 50, "--json", "power.json")
    assert (code, err) == (0, "")
    assert "n for 0.8" in out
    assert (tmp_path / "out" / "analysis" / "exp3" / "power.png").is_file()
    assert len(json.loads((tmp_path / "power.json").read_text(encoding="utf-8"))["power"][0]) == 2
