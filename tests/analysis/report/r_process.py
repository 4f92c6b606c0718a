"""Scripts of reports run in one R, which takes longer to load its packages than to compute."""

import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

LOOP = """
for (path in commandArgs(TRUE)) {
  cat("\\n@@", path, "\\n", sep = "")
  setwd(dirname(path))
  env <- new.env(parent = globalenv())
  end <- structure(class = c("ended", "error", "condition"), list(message = "", call = NULL))
  env$commandArgs <- function(...) character()
  env$quit <- function(...) stop(end)
  tryCatch(sys.source(basename(path), envir = env), ended = function(e) NULL,
    error = function(e) cat("error:", conditionMessage(e), "\\n"))
}
"""


@cache
def r_has(*packages: str) -> bool:
    """Whether R and these packages are installed; they are not loaded."""
    rscript = shutil.which("Rscript")
    names = ", ".join(f'"{name}"' for name in packages)
    asked = f"cat(all(nzchar(sapply(c({names}), function(one) system.file(package = one)))))"
    call = [rscript or "", "--vanilla", "-e", asked]
    return rscript is not None and (
        not packages or subprocess.run(call, capture_output=True, text=True, check=False).stdout == "TRUE"
    )


def needed(*packages: str) -> None:
    """Skip where they are missing."""
    if not r_has(*packages):
        pytest.skip(f"R with {', '.join(packages)} is not installed")


def run_together(scripts: Sequence[Path]) -> list[str]:
    """What each script says, in turn."""
    call = [shutil.which("Rscript") or "", "--vanilla", "-e", LOOP, *map(str, scripts)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    said = [part.partition("\n")[2].strip() for part in done.stdout.split("\n@@")[1:]]
    assert len(said) == len(scripts), done.stdout + done.stderr
    return said
