"""Run a report's own R scripts, where R is installed."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from analysis.report.r_models import MODEL_SCRIPTS
from analysis.report.r_script import SCRIPT
from experiments.errors import InputError

TIMEOUT_S, MODELS_TIMEOUT_S = 600, 180


def rscript() -> str:
    """The path of Rscript; InputError where no R is installed."""
    path = shutil.which("Rscript")
    if path is None:
        raise InputError("--verify-with-r: no Rscript on the PATH; install R, or run verify.R elsewhere")
    return path


def verify_with_r(files: Sequence[Path]) -> str:
    """Run every script among the report's files; what R said.

    Raises
    ------
    InputError
        A number differs, a package is missing, or the report has nothing that R can compute anew.
    """
    scripts = [path for path in files if path.name.endswith(SCRIPT)]
    if not scripts:
        raise InputError("--verify-with-r: this kind of report has no R script yet")
    return "\n".join(_run(path) for path in scripts)


def _run(script: Path) -> str:
    limit = MODELS_TIMEOUT_S if script.name.endswith(MODEL_SCRIPTS) else TIMEOUT_S
    try:
        told = subprocess.run(  # noqa: S603 - the project's own script, in a folder that the caller chose
            [rscript(), "--vanilla", script.name],
            env={**os.environ, "LC_ALL": "C.UTF-8"},
            cwd=script.parent,
            capture_output=True,
            text=True,
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        # R's mixed models of many slopes take from minutes to hours
        return f"{script.name} did not end in {limit} s, and was not compared: run it by itself"
    if told.returncode != 0:
        said = [
            line for line in (told.stdout + told.stderr).splitlines() if "DIFFER" in line or "rror" in line
        ]
        raise InputError(f"{script}: {' '.join(' | '.join(said).split()) or 'R ended without a word'}")
    return told.stdout.strip()
