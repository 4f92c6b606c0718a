"""Run a report's own R scripts, where R is installed."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from analysis.report.r_models import MODEL_SCRIPTS
from analysis.report.r_script import SCRIPT
from experiments.errors import InputError


def rscript() -> str:
    """The path of Rscript; InputError where no R is installed."""
    path = shutil.which("Rscript")
    if path is None:
        raise InputError("--verify-with-r: no Rscript on the PATH; install R, or run verify.R elsewhere")
    return path


def verify_with_r(files: Sequence[Path], say: Callable[[str], None] = lambda _: None) -> Iterator[str]:
    """Run every script among the report's files, those of models last; what R said of each, as it ends.

    No script is cut off: R's mixed models of many slopes take minutes, on a busy machine more.

    Parameters
    ----------
    files : sequence of Path
        The report's files, of which the scripts are run.
    say : callable
        Told the name of each script of a model before it begins.

    Raises
    ------
    InputError
        A number differs, a package is missing, or the report has nothing that R can compute anew.
    """
    scripts = [path for path in files if path.name.endswith(SCRIPT)]
    if not scripts:
        raise InputError("--verify-with-r: this kind of report has no R script yet")
    for path in sorted(scripts, key=_is_model):
        if _is_model(path):
            say(path.name)
        yield _run(path)


def _is_model(script: Path) -> bool:
    return script.name.endswith(MODEL_SCRIPTS)


def _run(script: Path) -> str:
    told = subprocess.run(  # noqa: S603 - the project's own script, in a folder that the caller chose
        [rscript(), "--vanilla", script.name],
        env={**os.environ, "LC_ALL": "C.UTF-8"},
        cwd=script.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    if told.returncode != 0:
        said = [
            line for line in (told.stdout + told.stderr).splitlines() if "DIFFER" in line or "rror" in line
        ]
        raise InputError(f"{script}: {' '.join(' | '.join(said).split()) or 'R ended without a word'}")
    return told.stdout.strip()
