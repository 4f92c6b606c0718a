"""The report's R script computes its tables again: where R is, it agrees, and it finds a changed number."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.read.long_csv import read_long_table
from analysis.report.r_script import r_files
from analysis.within.cell_means import cell_table
from experiments.errors import InputError
from tests.analysis.cell_analysis import analyse_cells
from tests.analysis.report.r_process import needed, run_together

GOLDEN = Path(__file__).parents[2] / "golden/r"
CALL = ("--participant", "participant", "--rating", "rating")
OF_CELLS = "--participant participant --rating rating --within A,B"
OF_GROUPS = "--participant id --rating y --within phase,hour --between treatment,gender --covariate age"
CASES = {
    "within": ("within/complete_2.csv", f"{OF_CELLS} --equivalence -0.3,0.5"),
    "both": ("between/obk_age.csv", f"{OF_GROUPS} --equivalence 1.5"),
    "between": ("between/between_only.csv", "--participant id --rating y --between g,h --type 2"),
    "few": ("within/few_participants_2.csv", OF_CELLS),
    "box": ("box_m.csv", "--participant id --rating score --within A,B --between group"),
    "changed": ("between/between_only.csv", "--participant id --rating y --between g,h"),
}


ROBUST = {
    "few": ("within/few_participants_2.csv", f"{OF_CELLS} --robust"),
    "type 2": ("between/between_only.csv", "--participant id --rating y --between g,h --type 2 --robust"),
}


def report(folder: Path, file: str, options: str) -> Path:
    call = ["anova", str(GOLDEN / file), "--out", str(folder), *options.split()]
    told = CliRunner().invoke(app, call)
    assert told.exit_code == 0, told.output
    return folder / "verify.R"


@pytest.fixture(scope="module")
def of_r(tmp_path_factory) -> dict[str, str]:
    """What R says of every case; of `changed` one cell mean is another."""
    needed("afex", "car", "emmeans")
    folder = tmp_path_factory.mktemp("r")
    scripts = [report(folder / name, *case) for name, case in CASES.items()]
    path = folder / "changed" / "cell-means.csv"
    data = path.read_text().splitlines()
    *cells, mean = data[1].split(",")
    data[1] = ",".join([*cells, str(float(mean) + 0.01)])
    path.write_text("\n".join(data))
    return dict(zip(CASES, run_together(scripts), strict=True))


@pytest.fixture(scope="module")
def of_robust(tmp_path_factory) -> dict[str, str]:
    """What R says of the robust companions of every case; of `changed` one cell mean is another."""
    needed("afex", "car")
    folder = tmp_path_factory.mktemp("robust")
    scripts = [report(folder / name, *case) for name, case in ROBUST.items()]
    scripts.append(report(folder / "changed", *ROBUST["few"]))
    path = scripts[-1].with_name("cell-means.csv")
    data = path.read_text().splitlines()
    *cells, mean = data[1].split(",")
    data[1] = ",".join([*cells, str(float(mean) + 3)])
    path.write_text("\n".join(data))
    said = run_together([script.with_name("robust-verify.R") for script in scripts])
    return dict(zip([*ROBUST, "changed"], said, strict=True))


@pytest.mark.parametrize(
    ("case", "tables"),
    [
        ("few", "trimmed  A, trimmed  B, ranks    F, ranks    epsilon, permuted F, permuted p "),
        ("type 2", "trimmed  g, trimmed  h, ranks    p, permuted F, permuted p (drawn)"),
    ],
)
def test_r_agrees_with_the_robust_companions(of_robust, case, tables) -> None:
    assert "Every number agrees with R." in of_robust[case], of_robust[case]
    for table in tables.split(", "):
        assert f"\n{table}" in f"\n{of_robust[case]}"


def test_r_finds_changed_robust_companions(of_robust) -> None:
    differing = [line for line in of_robust["changed"].splitlines() if line.endswith("DIFFER")]
    assert {line.split()[0] for line in differing} == {"trimmed", "ranks", "permuted"}


@pytest.mark.parametrize("case", [name for name in CASES if name != "changed"])
def test_r_agrees_with_every_number(of_r, case) -> None:
    assert "Every number agrees with R." in of_r[case], of_r[case]
    assert "DIFFER" not in of_r[case]


@pytest.mark.parametrize(
    ("case", "tables"),
    [
        (
            "within",
            "sizes    partial, sizes    general, sizes    omega, sizes    interval, sizes    mv interv.",
        ),
        ("within", "dz       dz, dz       interval, bayes    BF10, tost     A, tost     B"),
        (
            "both",
            "adjusted, contrast, effects  Pillai, simple   F, simple   p, dz       interval, levene   F",
        ),
        ("both", "bayes    BF10, tost     treatment, tost     hour"),
        ("between", "sizes    interval, dz       dz, levene   p"),
        ("box", "levene   F, box      M"),
    ],
)
def test_every_kind_of_number_is_compared(of_r, case, tables) -> None:
    for table in tables.split(", "):
        assert f"\n{table}" in of_r[case]


def test_r_finds_a_changed_number(of_r) -> None:
    differing = [line for line in of_r["changed"].splitlines() if line.endswith("DIFFER")]
    kinds = {line.split()[0] for line in differing}
    assert {"effects", "means", "pairs", "sizes", "dz"} <= kinds
    assert "Some numbers DIFFER from R." in of_r["changed"]


ALTERED = {
    "margin,cell,mean,se,low,high": {"phase:hour": ("mean", "low"), "treatment": ("high",)},
    "margin,first,second,difference,se,df,t,p,low,high": {"hour": ("low",), "gender": ("t",)},
    "factor,name,estimate,se,t,p,low,high": {"hour": ("p",)},
    "of,F,df,df_error,p,test": {"phase": ("df",)},
    "margin,p,bonferroni,holm,sidak,fdr,t,df,means,tukey": {"phase": ("tukey",)},
}
"""By the head of a table of `verify.R`: of which rows the first has another number, and which."""


def altered(script: str) -> str:
    """The script with a hundredth more of each number of `ALTERED`."""
    lines = script.splitlines()
    for head, rows in ALTERED.items():
        start = next(i for i, line in enumerate(lines) if line.endswith(f'"{head}')) + 1
        for name, columns in rows.items():
            at = next(i for i in range(start, len(lines)) if lines[i].startswith(f"{name},"))
            cells = lines[at].split(",")
            for column in columns:
                place = head.split(",").index(column)
                cells[place] = repr(float(cells[place]) * 1.01 + 0.01)
            lines[at] = ",".join(cells)
    return "\n".join(lines)


def test_r_finds_each_altered_number_and_no_other(tmp_path) -> None:
    needed("afex", "car", "emmeans")
    path = report(tmp_path / "altered", *CASES["both"])
    path.write_text(altered(path.read_text()))
    (said,) = run_together([path])
    differing = {tuple(line.split()[:-7]) for line in said.splitlines() if line.endswith(": DIFFER")}
    assert {" ".join(words) for words in differing} == {
        "means phase:hour",
        "means ci phase:hour",
        "means ci treatment",
        "pairs gender",
        "pairs ci hour",
        "contrast hour",
        "simple df",
        "tukey phase",
    }


def test_r_agrees_with_pairs_of_two_factors_and_a_cell_in_which_nobody_differs(tmp_path) -> None:
    """An error that is zero, or rounding, is not a number to compare relatively."""
    needed("afex", "car", "emmeans")
    rows = read_long_table(GOLDEN / "within/complete_2.csv", "participant", "rating", ["A", "B"]).rows
    first = (rows["A"] == rows["A"].iloc[0]) & (rows["B"] == rows["B"].iloc[0])
    rows.loc[first, "rating"] = 6.1
    cells = cell_table(rows, "participant", "rating", ["A", "B"])
    about = {"name": "two", "title": "two", "source": "complete_2.csv", "rating": "rating"}
    for name, content in r_files(analyse_cells(cells, **about, two_factor_pairs=True)).items():
        (tmp_path / name).write_bytes(content)
    (said,) = run_together([tmp_path / "verify.R"])
    assert "\npairs    A:B " in said
    assert "Every number agrees with R." in said


def test_r_agrees_with_simple_effects_of_too_few_participants_for_an_exact_f(tmp_path) -> None:
    needed("afex", "car", "emmeans")
    rng = np.random.default_rng(11)
    y = rng.normal(size=(4, 2, 6)) + 5 * np.arange(2)[:, None] * np.arange(6)
    lines = [f"p{i},a{a},b{b},{y[i, a, b]}" for i, a, b in np.ndindex(y.shape)]
    path = tmp_path / "few.csv"
    path.write_text("\n".join(["id,A,B,y", *lines]))
    rows = read_long_table(path, "id", "y", ["A", "B"]).rows
    about = {"name": "few", "title": "few", "source": "few.csv", "rating": "y"}
    analysis = analyse_cells(cell_table(rows, "id", "y", ["A", "B"]), **about)
    kinds = {simple.of: simple.test.multivariate is None for simple in analysis.simple_effects}
    assert kinds == {"A": False, "B": True}
    for name, content in r_files(analysis).items():
        (tmp_path / name).write_bytes(content)
    (said,) = run_together([tmp_path / "verify.R"])
    assert "\nsimple   p " in said
    assert "\ntukey    B " in said
    assert "Every number agrees with R." in said, said


def test_r_finds_a_number_that_it_has_not_and_a_row_too_few(tmp_path) -> None:
    needed("afex", "car", "emmeans")
    missing = report(tmp_path / "missing", *CASES["few"])
    spoilt = missing.read_text().replace("means$SE", "NA * means$SE")
    missing.write_text(spoilt.replace("apart(mine$df, compared$df)", "apart(mine$df, compared$df[-1])"))
    (said,) = run_together([missing])
    differing = {line.split()[0] for line in said.splitlines() if line.endswith("DIFFER")}
    assert differing == {"means", "pairs"}


def test_names_and_levels_that_r_would_read_as_code_stay_text(tmp_path) -> None:
    path = tmp_path / "odd.csv"
    rows = [
        f'p{i},"{level}",{i % 3 + k}' for i in range(6) for k, level in enumerate(('""); quit(', "b\\", "Ä"))
    ]
    path.write_text("\n".join(["id,my factor,y", *rows]), encoding="utf-8")
    data = read_long_table(path, "id", "y", ["my factor"])
    cells = cell_table(data.rows, "id", "y", ["my factor"])
    analysis = analyse_cells(cells, name="odd", title="a\nb", source="odd.csv", rating="y")
    script = r_files(analysis)["verify.R"].decode()
    assert script.startswith("# a b\n")
    assert 'levels = c("\\"); quit(", "b\\\\", "Ä"), labels = c("l1", "l2", "l3")' in script
    assert "Error(participant/(variable_1))" in script


def test_r_reads_levels_and_factors_that_look_like_its_own_words(tmp_path) -> None:
    """Levels NA, True and 01 are not missing, TRUE and 1; factors may have the names of R's own columns."""
    needed("afex", "car", "emmeans")
    rng = np.random.default_rng(3)
    path = tmp_path / "words.csv"
    rows = [
        f"p{i},{group},{20 + 3 * i % 19},{shown},{number},{rng.normal():.3f}"
        for i, group in enumerate(["NA", "True", "1e1", "NA"] * 4)
        for shown in ("True", "False")
        for number in ("1", "01", "NaN")
    ]
    path.write_text("\n".join(["id,SE,df,rating,next,score", *rows]))
    call = ["anova", str(path), "--participant", "id", "--rating", "score", "--within", "rating,next"]
    call += ["--between", "SE", "--covariate", "df", "--robust", "--out", str(tmp_path / "words")]
    told = CliRunner().invoke(app, call)
    assert told.exit_code == 0, told.output
    for said in run_together([tmp_path / "words" / name for name in ("verify.R", "robust-verify.R")]):
        assert "Every number agrees with R." in said, said


def test_without_a_report_there_is_nothing_to_verify() -> None:
    call = ["anova", str(GOLDEN / "within/complete_1.csv"), *CALL, "--within", "A", "--verify-with-r"]
    told = CliRunner().invoke(app, call)
    assert isinstance(told.exception, InputError)
    assert "report folder: add, for example, --out results" in str(told.exception)


def test_a_size_that_r_has_not_differs(tmp_path) -> None:
    needed("afex", "car", "emmeans")
    path = report(tmp_path / "lacking", *CASES["within"])
    script = path.read_text()
    lacks = {"sizes <- as.data.frame(": "sizes$ges[1] <- NA", "own_dz <- ": "own_dz[1] <- own$n[1] <- NA"}
    for line, lack in lacks.items():
        at = script.index("\n", script.index(f"\n{line}") + 1)
        script = f"{script[:at]}\n{lack}{script[at:]}"
    path.write_text(script)
    (said,) = run_together([path])
    differing = {" ".join(line.split()[:2]) for line in said.splitlines() if line.endswith(": DIFFER")}
    assert differing == {"sizes general", "dz dz", "dz interval", "bayes BF10"}


def test_bounds_beyond_what_r_can_are_counted_aloud(tmp_path) -> None:
    needed("afex", "car", "emmeans")
    rows = [
        f"p{i},a{a},{5 * a + (i * (3 + a) % 7) / 900 + (a == 2) * (i % 3)}"
        for i in range(9)
        for a in range(3)
    ]
    (tmp_path / "far.csv").write_text("\n".join(["id,A,y", *rows]))
    call = ["anova", str(tmp_path / "far.csv"), "--participant", "id", "--rating", "y", "--within", "A"]
    told = CliRunner().invoke(app, [*call, "--out", str(tmp_path / "far")])
    assert told.exit_code == 0, told.output
    (said,) = run_together([tmp_path / "far" / "verify.R"])
    assert re.search(r"[24] of 6 numbers not compared: beyond R's noncentral t", said), said
    assert "Every number agrees with R." in said
