"""The analysis against R on data sets that no test holds: how many numbers, and the worst difference.

    PYTHONPATH=. python tests/bench/unseen_against_r.py [FOLDER]

Runs `unseen_anova.R`, `unseen_models.R` and `unseen_choices.R` (some minutes; not where FOLDER holds their
files) and the commands of `analysis` on the same CSV files. Differences are relative: the worst of all
numbers but the bounds of sizes, then that of these. Needs Rscript with afex, emmeans, effectsize,
BayesFactor, lmerTest, ordinal, BradleyTerry2, psyphy, psych, psychotools, mlmRev and jsonlite.
"""

import json
import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from analysis.cli import app

HERE = Path(__file__).parent
Number = tuple[str, float | None, float | None]
"""What, ours, R's."""

NEAR_ZERO = 1e-11
"""Differences below this, of the largest mean where means are compared, are rounding."""


def answers(folder: Path) -> None:
    """Let R write its files."""
    for part in ("anova", "models", "choices"):
        subprocess.run(["Rscript", str(HERE / f"unseen_{part}.R"), str(folder)], check=True)


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
    """Log-likelihood, thresholds, SDs."""
    mine = ours(csv, "ordinal", columns(r))
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


def main() -> None:
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


if __name__ == "__main__":
    main()
