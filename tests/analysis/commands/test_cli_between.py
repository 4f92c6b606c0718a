"""`analysis anova` with groups and covariates: the JSON, the words, and what is refused."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.cli import app

OBK = Path(__file__).parents[2] / "golden" / "r" / "between" / "obk.csv"


def anova(file: Path, *arguments: str):
    return CliRunner().invoke(app, ["anova", str(file), "--participant", "id", "--rating", "y", *arguments])


def test_a_whole_mixed_design_to_json(tmp_path) -> None:
    out = tmp_path / "o.json"
    result = anova(
        OBK,
        "--within",
        "phase,hour",
        "--between",
        "treatment,gender",
        "--covariate",
        "age",
        "--json",
        str(out),
    )
    assert result.exit_code == 0, result.output
    data = json.loads(out.read_text())
    assert [b["factor"] for b in data["between"]] == ["treatment", "gender"]
    assert data["covariates"][0]["name"] == "age"
    assert data["type"] == 3
    assert len(data["effects"]) == 19
    assert "covariate 'age' was centered at its mean" in " ".join(result.output.split())
    assert "groups differ in size" in result.output


def test_the_type_of_sums_of_squares_is_chosen(tmp_path) -> None:
    ss = {}
    for kind in ("2", "3"):
        out = tmp_path / f"{kind}.json"
        arguments = ("--within", "phase", "--between", "treatment,gender", "--type", kind)
        assert anova(OBK, *arguments, "--json", str(out)).exit_code == 0
        effects = json.loads(out.read_text())["effects"]
        ss[kind] = next(e["univariate"]["ss"] for e in effects if e["effect"] == "treatment")
    assert ss["2"] != pytest.approx(ss["3"], rel=1e-3)


HEAD = "id,group,age,face,y\n"
FULL = HEAD + "".join(
    f"{who},{'g' if who < 4 else 'h'},{20 + who * who},{face},{who + k * (who % 3)}\n"
    for who in range(8)
    for k, face in enumerate("ab")
)


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (
            FULL.replace("3,g,29,b", "3,h,29,b"),
            ("--between", "group"),
            "'group' differs within participant 3 (g",
        ),
        (FULL.replace("3,g,29,b", "3,g,30,b"), ("--covariate", "age"), "'age' differs within participant 3"),
        (FULL.replace(",h,", ",g,"), ("--between", "group"), "at least 2 levels of 'group', got 1"),
        (FULL, ("--between", "face"), "'face' differs within participant 0"),
        (FULL, ("--between", "group", "--covariate", "group"), "'group' is named for two roles"),
        (FULL, ("--covariate", "face"), "'face' should be a number, got 'a' in line 2"),
        (FULL.replace(",face,y", ",hair,y"), ("--between", "group,hair"), "differs within participant"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tmp_path, text, arguments, message) -> None:
    file = tmp_path / "t.csv"
    file.write_text(text)
    result = anova(file, *arguments)
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)


def test_an_empty_group_is_named(tmp_path) -> None:
    file = tmp_path / "t.csv"
    rows = [
        (0, "g", "m"),
        (1, "g", "m"),
        (2, "g", "f"),
        (3, "h", "m"),
        (4, "h", "m"),
        (5, "h", "m"),
        (6, "g", "f"),
    ]
    file.write_text("id,group,sex,y\n" + "".join(f"{i},{g},{s},{i * i % 5}\n" for i, g, s in rows))
    assert "nobody with complete data is in group=h sex=f" in str(
        anova(file, "--between", "group,sex").exception
    )


def test_a_group_of_which_nobody_rated_every_cell_is_named(tmp_path) -> None:
    file = tmp_path / "t.csv"
    rows = [f"{i},{'gh'[i % 2]},{t},{i + t}\n" for i in range(8) for t in range(3) if (i % 2, t) != (1, 2)]
    file.write_text("id,group,time,y\n" + "".join(rows))
    said = str(anova(file, "--within", "time", "--between", "group").exception)
    assert "nobody in group=h has a rating in every cell within participants, so all 4 were" in said


def test_a_participant_without_a_covariate_is_left_out_and_named(tmp_path) -> None:
    file = tmp_path / "t.csv"
    file.write_text(FULL.replace("3,g,29,", "3,g,,"))
    result = anova(file, "--within", "face", "--covariate", "age")
    assert result.exit_code == 0, result.exception
    assert "excluded because 'age' is missing: participant 3" in result.output
    assert "7 participants" in result.output


def test_a_code_for_missing_in_a_covariate_is_named(tmp_path) -> None:
    file = tmp_path / "a.csv"
    rows = [
        f"{person},{face},{age},{1 + (person * place) % 5}"
        for person, age in enumerate((23, -99, 31, 27, 40, 35, 29), 1)
        for place, face in enumerate("ab", 1)
    ]
    file.write_text("\n".join(["id,face,age,y", *rows]), encoding="utf-8")
    result = anova(file, "--within", "face", "--covariate", "age")
    assert result.exit_code == 0, result.output
    assert "'age' has -99 (lines 4, 5), often a code for missing values" in " ".join(result.output.split())


def test_a_covariate_that_the_groups_determine_is_refused(tmp_path) -> None:
    file = tmp_path / "t.csv"
    file.write_text("id,g,x,y\n" + "".join(f"{i},{'ab'[i % 2]},{i % 2},{i * i % 7}\n" for i in range(8)))
    assert "determined by the other groups" in str(
        anova(file, "--between", "g", "--covariate", "x").exception
    )


def test_follow_up_tests_are_in_the_json(tmp_path) -> None:
    out = tmp_path / "o.json"
    arguments = (
        "--within",
        "hour",
        "--between",
        "treatment",
        "--equivalence",
        "0.8",
        "--contrast",
        "hour:-1,0,0,0,1",
    )
    result = anova(OBK, *arguments, "--json", str(out))
    assert result.exit_code == 0, result.exception
    data = json.loads(out.read_text())
    assert [t["name"] for t in data["trends"]] == ["linear", "quadratic", "cubic", "quartic"]
    assert data["contrasts"][0]["weights"] == [-1, 0, 0, 0, 1]
    assert len(data["equivalence"]) == len(data["pairwise"]) == 10 + 3
    assert data["simple_effects"] == [] or {"of", "at", "p_holm"} <= set(data["simple_effects"][0])
    assert "Trends and contrasts" in result.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--equivalence", "0.2,0.5"), "--equivalence should be like"),
        (("--contrast", "hour:1,1,-1,0,0"), "sum to zero"),
        (("--contrast", "hour:a,b"), "--contrast should be like"),
        (("--contrast", "our:1,-1"), "did you mean 'hour'"),
    ],
)
def test_wrong_follow_ups_are_refused(arguments, message) -> None:
    assert message in str(anova(OBK, "--within", "hour", *arguments).exception)


def test_a_group_of_one_participant_is_named(tmp_path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(FULL.replace("7,h,", "7,alone,"))
    result = anova(path, "--within", "face", "--between", "group")
    assert result.exit_code == 0, result.output
    said = " ".join(result.output.split())
    assert "group alone has one participant: its variance is unknown" in said
    assert "group g has one" not in said


def test_slopes_that_a_group_of_one_does_not_determine_are_named(tmp_path) -> None:
    """The intercept cannot be distinguished from that group's slope either, and it has no name."""
    file = tmp_path / "t.csv"
    file.write_text(
        HEAD
        + "".join(
            f"{who},{'h' if who == 7 else 'g'},{20 + who * who},{face},{who + k * (who % 3)}\n"
            for who in range(8)
            for k, face in enumerate("ab")
        )
    )
    arguments = ("--within", "face", "--between", "group", "--covariate", "age", "--covariate-by-group")
    result = anova(file, *arguments)
    assert (
        "'age:group' is determined by the other groups and covariates; leave --covariate-by-group out"
        in str(result.exception)
    )


@pytest.mark.parametrize("command", ["anova", "mixed"])
def test_the_order_of_levels_is_the_one_that_was_asked_for(command: str, tmp_path: Path) -> None:
    out = tmp_path / "o.json"
    arguments = [command, str(OBK), "--participant", "id", "--rating", "y", "--within", "phase"]
    arguments += ["--between", "treatment", "--json", str(out)]
    orders = ["--levels", "phase=pre,post,fup", "--levels", "treatment=control|B|A"]
    done = CliRunner().invoke(app, [*arguments, *orders])
    assert done.exit_code == 0, done.output
    assert "levels of 'phase' in the order given: pre, post, fup" in " ".join(done.output.split())
    data = json.loads(out.read_text())
    if command == "anova":
        assert data["levels"]["phase"] == ["pre", "post", "fup"]
        assert data["between"][0]["levels"] == ["control", "B", "A"]
        by_name = {(p["level_a"], p["level_b"]): p["difference"] for p in data["pairwise"]}
        assert ("pre", "post") in by_name
        means = {m["levels"]["phase"]: m["mean"] for m in data["marginal_means"] if m["effect"] == "phase"}
        assert by_name["pre", "post"] == pytest.approx(means["pre"] - means["post"])
    else:
        names = [c["name"] for c in data["coefficients"]]
        assert names[1:5] == ["treatment[control]", "treatment[B]", "phase[pre]", "phase[post]"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("phase=pre,pst,fup", "did you mean 'post'"),
        ("phase=pre,fup", "post missing"),
        ("phase=pre,post,fup,pre", "once"),
        ("fase=pre", "did you mean 'phase'"),
        ("phase", "should be like"),
    ],
)
def test_an_order_that_is_not_one_of_the_levels_is_refused(given: str, said: str) -> None:
    done = anova(OBK, "--within", "phase", "--levels", given)
    assert said in str(done.exception)
