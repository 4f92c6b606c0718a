"""Mixed and ordinal models and the ANOVA against R's own calls, on data that R's packages ship, in one run.

    PYTHONPATH=. python tests/bench/models_against_r.py

Prints CPU seconds of both, their ratio (above 1: faster than R) and how much the likelihoods differ. lmer
fits without tests; ours with Satterthwaite's. Needs Rscript with afex, lme4, lmerTest, ordinal and jsonlite.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from analysis.read.long_csv import design_of
from analysis.within.anova import linear_anova
from analysis.within.cell_means import cell_table

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
        "factorial": lambda: anova(factorial, "id", "rating", ["a", "b", "c", "d"]),
        "anova": lambda: anova(obk, "id", "value", ["phase", "hour"], ["treatment", "gender"]),
        # with the four multivariate statistics, which afex's call leaves to its summary
        "factorial+": lambda: anova(factorial, "id", "rating", ["a", "b", "c", "d"], several=True),
        "anova+": lambda: anova(obk, "id", "value", ["phase", "hour"], ["treatment", "gender"], several=True),
    }


def anova(
    rows: pd.DataFrame,
    who: str,
    rating: str,
    within: list[str],
    between: Sequence[str] = (),
    several: bool = False,
) -> float:
    """What afex's call does: from long rows to every effect's tests; with `several` the multivariate too."""
    cells = cell_table(rows, who, rating, within)
    design = design_of(rows, who, cells.participants, between, [])
    result = linear_anova(cells.y, cells.factors, cells.levels, design, 3, 0.95)
    if several:
        for effect in result.effects:
            _ = effect.multivariate
    return 0.0


def cpu(call: Callable[[], float]) -> tuple[float, float]:
    """The least CPU seconds of some calls, and what they gave."""
    start = time.process_time()
    call()
    brief = time.process_time() - start < BRIEF_S
    least = np.inf
    for _ in range(BRIEF_REPEATS if brief else REPEATS):
        start = time.process_time()
        value = call()
        least = min(least, time.process_time() - start)
    return float(least), value


def main() -> None:
    """Time both, and print a table."""
    r = shutil.which("Rscript")
    if r is None:
        sys.stdout.write("models against R: no Rscript on the PATH, nothing measured\n")
        return
    with tempfile.TemporaryDirectory() as name:
        script = Path(__file__).with_suffix(".R")
        subprocess.run([r, "--vanilla", str(script), name], check=True, capture_output=True)
        times = json.loads((Path(name) / "times.json").read_text(encoding="utf-8"))
        sys.stdout.write(f"{'model':10} {'R CPU s':>8} {'ours':>8} {'ratio':>7} {'likelihood - R':>15}\n")
        for model, call in fits(Path(name)).items():
            seconds, value = cpu(call)
            theirs = times[model.removesuffix("+")]
            ratio, apart = theirs["cpu"] / seconds, value - theirs["value"]
            sys.stdout.write(f"{model:10} {theirs['cpu']:8.3f} {seconds:8.4f} {ratio:7.1f} {apart:15.6f}\n")


if __name__ == "__main__":
    main()
