"""The analysis against R: data that no test holds, speed on data that R ships, which fit is nearer a maximum.

    python -m bench.against_r unseen [FOLDER]
    python -m bench.against_r speed
    python -m bench.against_r ordinal FOLDER NAME

unseen: Runs `unseen_anova.R`, `unseen_models.R` and `unseen_choices.R` (some minutes; not where FOLDER
holds their files) and the commands of `analysis` on the same CSV files. Differences are relative: the worst
of all numbers but the bounds of sizes, then that of these. Needs Rscript with afex, emmeans, effectsize,
BayesFactor, lmerTest, ordinal, BradleyTerry2, psyphy, psych, psychotools, mlmRev and jsonlite.

speed: mixed and ordinal models and the ANOVA against R's own calls. Prints CPU seconds of both, their ratio
(above 1: faster than R) and how much the likelihoods differ. lmer fits without tests; ours with
Satterthwaite's. The last row is the whole program, from its start to the same tables (`whole_anova.R`).
Needs Rscript with afex, effectsize, lme4, lmerTest, ordinal and jsonlite.

ordinal: Laplace's likelihood by its definition, in 80-bit floats. FOLDER holds what `unseen_models.R`
wrote; NAME is a model of it with one random intercept, such as Socatt. Nothing of `analysis.models` but the
design matrix is used. For clmm's fit and the one here: the log-likelihood, its largest derivative, how far
a Newton step moves any threshold (relative), and its gain.
"""

import json
import math
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from typer.testing import CliRunner

from analysis.cli import app
from analysis.models.columns import ModelTerms
from analysis.models.design import model_data
from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from analysis.read.long_csv import design_of
from analysis.within.anova import linear_anova
from analysis.within.cell_means import cell_table
from bench.harness import cpu_times_s, run_part

SCRIPTS = Path(__file__).parent / "r"
Number = tuple[str, float | None, float | None]
"""What, ours, R's."""

ANALYSIS = Path(sys.executable).with_name("analysis")
PROGRAM_RUNS = 7

NEAR_ZERO = 1e-11
"""Differences below this, of the largest mean where means are compared, are rounding."""


def answers(folder: Path) -> None:
    """Let R write its files."""
    for part in ("anova", "models", "choices"):
        subprocess.run(["Rscript", str(SCRIPTS / f"unseen_{part}.R"), str(folder)], check=True)


def ours(csv: Path, command: str, options: Sequence[str]) -> dict[str, Any]:
    """The JSON of one command."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "ours.json"
        told = CliRunner().invoke(app, [command, str(csv), *options, "--json", str(out)])
        if told.exit_code != 0:
            raise SystemExit(told.output)
        return dict(json.loads(out.read_text()))


def columns(asked: Mapping[str, Any]) -> list[str]:
    """Options that name columns."""
    options = ["--participant", asked["id"], "--rating", asked["y"]]
    for name in ("within", "between", "covariate", "item", "random"):
        given = asked.get(name) or []
        if given:
            options += [f"--{name}", ",".join([given] if isinstance(given, str) else given)]
    return options


def in_r(level: str) -> str:
    """A level as R names a column of it."""
    return re.sub(r"[^\w.]", ".", level)


def anova_numbers(csv: Path, r: Mapping[str, Any]) -> Iterator[Number]:
    """Tests, sizes, means, pairs, equivalence and simple effects."""
    asked = [*columns(r), "--type", str(r["type"]), "--equivalence", repr(r["bound"])]
    mine_all = ours(csv, "anova", asked)
    yield "n", mine_all["n_participants"], r["n"]
    effects = {frozenset(e["effect"].split(":")): e for e in mine_all["effects"]}
    for theirs in r["effects"]:
        mine = effects[frozenset(theirs["effect"].split(":"))]
        yield from _effect(mine, theirs)
    means = {_levels(m["levels"]): m for m in mine_all["marginal_means"]}
    for theirs in r["means"]:
        mine = means[_levels(theirs["levels"])]
        yield from ((f"mean {key}", mine[key], theirs[key]) for key in ("mean", "se"))
        yield from (("mean ci", a, b) for a, b in zip(mine["ci"], theirs["ci"], strict=True))
    for factor, rows in r["pairs"].items():
        yield from _pairs(mine_all, factor, rows)
    for theirs in r.get("simple") or []:
        for mine in mine_all["simple_effects"]:
            at = {key: in_r(value) for key, value in mine["at"].items()}
            if mine["of"] == theirs["of"] and at == {theirs["at_factor"]: theirs["at"]}:
                yield "simple", (mine["multivariate"] or {}).get("f_value"), theirs["f_value"]


def _levels(levels: Mapping[str, str]) -> frozenset[tuple[str, str]]:
    return frozenset((name, in_r(level)) for name, level in levels.items())


def _effect(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[Number]:
    for key, value in theirs["univariate"].items():
        yield f"univariate {key}", mine["univariate"][key], value
    for key in ("eta_sq_partial", "eta_sq_generalized", "omega_sq_partial"):
        if theirs[key] is not None:
            yield key, mine[key], theirs[key]
    for a, b in zip(mine["eta_sq_partial_ci"], theirs["eta_sq_partial_ci"], strict=True):
        yield "interval of eta", a, b
    for name, row in (theirs.get("statistics") or {}).items():
        several = mine["multivariate"]["statistics"][name]
        yield from ((f"{name} {key}", several[key], value) for key, value in row.items())


def _pairs(mine: Mapping[str, Any], factor: str, rows: Sequence[Mapping[str, Any]]) -> Iterator[Number]:
    pairs, equal = (
        {(in_r(p["level_a"]), in_r(p["level_b"])): p for p in mine[key] if p["effect"] == factor}
        for key in ("pairwise", "equivalence")
    )
    for theirs in rows:
        key = (theirs["level_a"], theirs["level_b"])
        sign = 1 if key in pairs else -1
        pair, bounds = (table[key[::sign]] for table in (pairs, equal))
        yield from ((f"pair {k}", sign * pair[k], theirs[k]) for k in ("difference", "t"))
        yield from (
            (f"pair {k}", pair[k], theirs[k]) for k in theirs if k == "se" or re.match(r"p(_[bhsf]|$)", k)
        )
        yield from (("pair ci", sign * a, b) for a, b in zip(pair["ci"][::sign], theirs["ci"], strict=True))
        if theirs.get("bayes_factor") is not None:
            yield "bayes factor", pair["bayes_factor"], theirs["bayes_factor"]
            yield "dz", sign * pair["dz"], theirs["dz"]
        for a, b in zip(pair["dz_ci"][::sign], theirs.get("dz_ci") or [], strict=False):
            yield "interval of dz", sign * a, b
        yield "equivalence", bounds["p_lower"], theirs["p_lower" if sign == 1 else "p_upper"]
        yield "equivalence", bounds["p_upper"], theirs["p_upper" if sign == 1 else "p_lower"]


def mixed_numbers(csv: Path, r: Mapping[str, Any]) -> Iterator[Number]:
    """REML criterion, residual SD; F, df and p by Satterthwaite and by Kenward and Roger."""
    for method, keys in (("satterthwaite", ("F", "d2", "p")), ("kenward-roger", ("kF", "kd2", "kp"))):
        if r["effects"][0].get(keys[0]) is None:
            continue
        mine = ours(csv, "mixed", [*columns(r), "--slopes", r["slopes"], "--df", method])
        yield "REML criterion", mine["reml_criterion"], r["reml"]
        yield "residual SD", mine["sigma"], r["sigma"]
        effects = {frozenset(e["effect"].split(":")): e for e in mine["effects"]}
        for theirs in r["effects"]:
            effect = effects[frozenset(theirs["effect"].split(":"))]
            for name, key in zip(("f_value", "df_error", "p_value"), keys, strict=True):
                yield f"{method} {name}", effect[name], theirs[key]


def ordinal_numbers(csv: Path, r: Mapping[str, Any]) -> Iterator[Number]:
    """Log-likelihood, thresholds, SDs, by the approximation of clmm (Laplace)."""
    mine = ours(csv, "ordinal", [*columns(r), "--quadrature", "1"])
    yield "log-likelihood", mine["log_likelihood"], r["loglik"]
    yield from (("threshold", a, b) for a, b in zip(mine["thresholds"], r["alpha"], strict=True))
    yield "SD", mine["sd_participant"], r["sds"][0]
    if r.get("item"):
        yield "SD", mine["sd_item"], r["sds"][1]


def pairs_numbers(csv: Path, r: Mapping[str, Any]) -> Iterator[Number]:
    """Abilities, their errors and p, side and ties."""
    options = ["--method", r["method"], *(["--order-effect"] if r["order"] else [])]
    options += ["--tie", "tie"] if r["method"] == "davidson" else []
    options += ["--participant", "rater"] if "rater" in csv.open().readline() else []
    mine = ours(csv, "pairs", options)
    items = {item["name"]: item for item in mine["items"]}
    for at, name in enumerate(r["items"]):
        if at > 0:
            yield from ((key, items[name][key], r[key][at]) for key in ("ability", "se", "p"))
            if "robust" in r:
                yield "robust se", items[name]["se_robust"], r["robust"][at]
    for key, theirs in (("order_effect", r.get("oe")), ("log_nu", r.get("log_nu"))):
        if theirs:
            yield key, mine[key]["estimate"], theirs[0]
            yield key, mine[key]["se"], theirs[1]


def thresholds_numbers(csv: Path, r: Mapping[str, Any]) -> Iterator[Number]:
    """Threshold, spread, log-likelihood, deviance."""
    shape = "logistic" if "logit" in r["link"] else "normal"
    options = ["--x", "x", "--response", "response", "--guess", str(r["guess"]), "--function", shape]
    mine = ours(csv, "thresholds", options)["pooled"]["all"]
    names = {
        "threshold": "threshold",
        "spread": "spread",
        "ll": "log_likelihood",
        "dev": "deviance",
        "df": "df",
    }
    yield from ((name, mine[name], r[key]) for key, name in names.items())


KINDS = {
    "anova": anova_numbers,
    "mixed": mixed_numbers,
    "ordinal": ordinal_numbers,
    "pairs": pairs_numbers,
    "thresholds": thresholds_numbers,
}


def apart(mine: float | None, theirs: float | None) -> float:
    """Relative difference; infinite where one of the two has no number."""
    if mine is None or theirs is None:
        return 0.0 if mine is theirs else math.inf
    difference = abs(mine - theirs)
    return (
        0.0 if difference <= NEAR_ZERO * max(1.0, abs(theirs)) else difference / max(abs(mine), abs(theirs))
    )


def summary(numbers: Sequence[Number]) -> str:
    """How many numbers, the worst of them, and the worst bound of an interval of a size."""
    text = f"{len(numbers):5} numbers"
    for kind in ("", "interval"):
        these = [number for number in numbers if number[0].startswith("interval") == bool(kind)]
        what, mine, theirs = max(these, key=lambda number: apart(*number[1:]), default=("none", None, None))
        text += f"  {what} {apart(mine, theirs):.1e}"
    return text


def compare_unseen() -> None:
    """Compare, and print a line for each file."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    if not list(folder.glob("*.json")):
        answers(folder)
    for path in sorted(folder.glob("*.json")):
        r = json.loads(path.read_text())
        csv = folder / f"{r.get('n') if r['command'] == 'pairs' else re.sub(r'_[23]$', '', path.stem)}.csv"
        told = summary(list(KINDS[r["command"]](csv, r)))
        sys.stdout.write(f"{r['command']:10} {path.stem:22} {told}\n")
        sys.stdout.flush()


REPEATS, BRIEF_REPEATS, BRIEF_S = 3, 50, 0.02
"""Calls timed; those briefer than `BRIEF_S` are timed more often, as a moment of load is longer than they."""


def fits(folder: Path) -> dict[str, Callable[[], float]]:
    """Our calls, by the names of R's; each gives its REML criterion or log-likelihood."""
    ks, fhch, insteval, obk, factorial = (
        pd.read_csv(folder / f"{name}.csv") for name in ("ks", "fhch", "insteval", "obk", "factorial")
    )
    of_ks = ("id", "response", ["validity", "believability"], "content")
    factors = ["stimulus", "density", "frequency"]
    return {
        "ks": lambda: fit_mixed(ks, *of_ks, "main").reml_criterion,
        "fhch": lambda: fit_mixed(fhch, "id", "log_rt", factors, "item", "main").reml_criterion,
        "insteval": lambda: fit_mixed(insteval, "s", "y", ["service"], "d", "none").reml_criterion,
        "clmm": lambda: fit_ordinal(ks, *of_ks).log_likelihood,
        "factorial": lambda: anova_by_columns(factorial, "id", "rating", ["a", "b", "c", "d"]),
        "anova": lambda: anova_by_columns(obk, "id", "value", ["phase", "hour"], ["treatment", "gender"]),
        # with the four multivariate statistics, which afex's call leaves to its summary
        "factorial+": lambda: anova_by_columns(factorial, "id", "rating", ["a", "b", "c", "d"], several=True),
        "anova+": lambda: anova_by_columns(
            obk, "id", "value", ["phase", "hour"], ["treatment", "gender"], several=True
        ),
    }


def anova_by_columns(
    rows: pd.DataFrame,
    person_column: str,
    rating: str,
    within: list[str],
    between: Sequence[str] = (),
    several: bool = False,
) -> float:
    """What afex's call does: from long rows to every effect's tests; with `several` the multivariate too."""
    cells = cell_table(rows, person_column, rating, within)
    design = design_of(rows, person_column, cells.participants, between, [])
    result = linear_anova(cells.y, cells.factors, cells.levels, design, 3, 0.95)
    if several:
        for effect in result.effects:
            _ = effect.multivariate
    return 0.0


def least_cpu_s(call: Callable[[], float]) -> tuple[float, float]:
    """The least CPU seconds of some calls, and what they gave."""
    value = call()
    brief = cpu_times_s(call, 1)[0] < BRIEF_S
    return min(cpu_times_s(call, BRIEF_REPEATS if brief else REPEATS)), value


def compare_speed() -> None:
    """Time both, and print a table."""
    r = shutil.which("Rscript")
    if r is None:
        sys.stdout.write("models against R: no Rscript on the PATH, nothing measured\n")
        return
    with tempfile.TemporaryDirectory() as name:
        script = SCRIPTS / "speed.R"
        subprocess.run([r, "--vanilla", str(script), name], check=True, capture_output=True)
        times = json.loads((Path(name) / "times.json").read_text(encoding="utf-8"))
        sys.stdout.write(f"{'model':10} {'R CPU s':>8} {'ours':>8} {'ratio':>7} {'likelihood - R':>15}\n")
        for model, call in fits(Path(name)).items():
            seconds, value = least_cpu_s(call)
            theirs = times[model.removesuffix("+")]
            ratio, apart = theirs["cpu"] / seconds, value - theirs["value"]
            sys.stdout.write(f"{model:10} {theirs['cpu']:8.3f} {seconds:8.4f} {ratio:7.1f} {apart:15.6f}\n")
        theirs_s, seconds = whole_programs(r, Path(name) / "cells.csv")
        sys.stdout.write(f"{'program':10} {theirs_s:8.3f} {seconds:8.4f} {theirs_s / seconds:7.1f}\n")


def whole_programs(r: str, table: Path) -> tuple[float, float]:
    """Median CPU seconds of R's whole program and of `analysis anova`, run in turn on 26 people's ratings."""
    draws = np.random.default_rng(1)
    rows = pd.MultiIndex.from_product(
        [range(26), [*"pqr"], [*"xyz"], range(5)], names=["id", "face", "speed", "n"]
    )
    rating = 4 + np.repeat(draws.normal(size=26), 45) + (rows.get_level_values("face") == "q")
    noisy = np.clip(np.round(rating + draws.normal(size=len(rows))), 1, 7)
    pd.DataFrame({"score": noisy}, index=rows).to_csv(table)
    asked = ["anova", str(table), "--participant", "id", "--rating", "score", "--within", "face,speed"]
    programs = ([r, "--vanilla", str(SCRIPTS / "whole_anova.R"), str(table)], [str(ANALYSIS), *asked])
    spent: tuple[list[float], list[float]] = ([], [])
    for _ in range(PROGRAM_RUNS):
        for program, seconds in zip(programs, spent, strict=True):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(program, check=True, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return float(np.median(spent[0])), float(np.median(spent[1]))


Real = np.longdouble
GRADIENT_STEP, HESSIAN_STEP = Real("1e-4"), Real("1e-3")


def logistic(x):
    """The distribution function, without overflow."""
    small = np.exp(-np.abs(x))
    return np.where(x >= 0, 1 / (1 + small), small / (1 + small))


def log_likelihood(q, x, category, person, k):
    """Laplace's, of thresholds (k), coefficients and one SD; each person's mode by Newton's method."""
    beta, sd = q[k:-1], q[-1]
    edges = np.concatenate([[Real(-10000)], q[:k], [Real(10000)]])
    u = np.zeros(person.max() + 1, Real)
    for _ in range(100):
        eta = x @ beta + sd * u[person]
        a, b = edges[category + 1] - eta, edges[category] - eta
        upper, lower = logistic(a), logistic(b)
        score, curve = -u, np.ones_like(u)
        np.add.at(score, person, sd * (upper + lower - 1))
        np.add.at(curve, person, sd**2 * (upper * (1 - upper) + lower * (1 - lower)))
        if np.abs(score).max() < 1e-15:
            break
        u = u + np.clip(score / curve, -0.7, 0.7)
    ratings = np.log(upper) + np.log(logistic(-b)) + np.log1p(-np.exp(b - a))
    return ratings.sum() - (u @ u) / 2 - np.log(curve).sum() / 2


def derivatives(value, q):
    """Gradient (five points) and second derivatives (central differences)."""
    n = len(q)
    h, e = GRADIENT_STEP, np.eye(n).astype(Real)
    gradient = [
        (8 * (value(q + h * d) - value(q - h * d)) - value(q + 2 * h * d) + value(q - 2 * h * d)) / (12 * h)
        for d in e
    ]
    h = HESSIAN_STEP
    above, below, at = ([value(q + s * h * d) for d in e] for s in (1, -1, 0))
    second = np.zeros((n, n))
    for i in range(n):
        second[i, i] = float((above[i] + below[i] - 2 * at[i]) / h**2)
        for j in range(i):
            both = value(q + h * (e[i] + e[j])) + value(q - h * (e[i] + e[j])) + 2 * at[i]
            second[i, j] = second[j, i] = float(
                (both - above[i] - above[j] - below[i] - below[j]) / (2 * h**2)
            )
    return np.array(gradient, float), second


def compare_ordinal() -> None:
    """Print a line a fit."""
    folder, name = Path(sys.argv[1]), sys.argv[2]
    r = json.loads((folder / f"{name}.json").read_text())
    # R writes what is empty as null.
    r |= {role: r.get(role) or [] for role in ("within", "between", "covariate")}
    rows = pd.read_csv(folder / f"{name}.csv", dtype=str)
    rows[[r["y"], *r["covariate"]]] = rows[[r["y"], *r["covariate"]]].astype(float)
    terms = ModelTerms(r["id"], r["y"], tuple(r["within"]), (), tuple(r["between"]), tuple(r["covariate"]))
    columns = {"between": r["between"], "covariates": r["covariate"]}
    here = fit_ordinal(rows, r["id"], r["y"], r["within"], **columns, quadrature=1)
    x = model_data(rows, terms).x[:, 1:]
    category = np.unique(rows[r["y"]], return_inverse=True)[1]
    person = np.unique(rows[r["id"]], return_inverse=True)[1]
    k = len(here.thresholds)
    fits = {
        "here": [*here.thresholds, *(c.estimate for c in here.coefficients), here.sd_participant],
        "clmm": [*r["alpha"], *np.linalg.lstsq(x, np.array(r["eta"]), rcond=None)[0], r["sds"][0]],
    }
    for label, fit in fits.items():
        q = np.array(fit, Real)
        gradient, second = derivatives(lambda p: log_likelihood(p, x.astype(Real), category, person, k), q)
        step = np.linalg.solve(-second, gradient)
        moved = np.abs(step[:k] / q[:k].astype(float)).max()
        value = float(log_likelihood(q, x.astype(Real), category, person, k))
        sys.stdout.write(
            f"{label}: log-likelihood {value:.10f}, largest derivative {np.abs(gradient).max():.1e}, "
            f"a Newton step moves thresholds by {moved:.1e} and gains {step @ gradient / 2:.1e}\n"
        )


PARTS = {
    "unseen": compare_unseen,
    "speed": compare_speed,
    "ordinal": compare_ordinal,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
