"""Run `analysis run` as a process of its own: the server carries no numerics."""

import shutil
import subprocess
import sys
from pathlib import Path

from server.locks import LONGEST_S


def run_analysis(
    definition: Path,
    answers: Path,
    folder: Path,
    *,
    origin: str,
    series: int,
    sensitivity: bool,
    runs: Path,
    seal: Path | None = None,
    manifest: Path | None = None,
) -> str:
    """Write the report into `folder`; return the analysis' own error line where it failed, else ''."""
    program = Path(sys.executable).with_name("analysis")
    command = [str(program), "run", str(definition), "--csv", str(answers)]
    command += ["--runs", str(runs)]
    command += ["--origin", origin, "--series", str(series), "--out", str(folder)]
    command += [] if sensitivity else ["--no-sensitivity"]
    command += ["--seal", str(seal)] if seal else []
    command += ["--manifest", str(manifest)] if manifest else []
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)  # noqa: S603
    if done.returncode == 0:
        return ""
    lines = [line for line in (done.stderr or done.stdout).splitlines() if line.strip()]
    shutil.rmtree(folder, ignore_errors=True)
    return (lines[-1] if lines else f"the analysis ended with code {done.returncode}")[:500]
