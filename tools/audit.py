"""Ask the advisory databases about every locked package: fail on a known weakness, report where nobody
answered.

No answer (no internet, a mirror without advisories) is not a failure, but never passes for "none known"
either.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
LOCKS = "-r requirements.lock -r requirements-dev.lock"
"""The second holds what deploy/s3.lock holds."""
ACCEPTED: dict[str, str] = {}
"""Advisories that are known and harmless here: their id, and why."""
LONGEST_S = 300
NO_ANSWER = "skipped: the advisory database did not answer (no internet, or a mirror without it)"
PIP_AUDIT = (
    f"-m pip_audit --disable-pip --require-hashes {LOCKS} --format json --progress-spinner off --timeout 15"
)


@dataclass(frozen=True)
class Outcome:
    """What is said of one ecosystem, and whether a weakness was found."""

    said: str
    weak: bool = False


def python_outcome(answer: str) -> Outcome:
    """From what `pip-audit --format json` prints; nothing at all where its service did not answer."""
    report = _json(answer)
    packages = report.get("dependencies", []) if report else []
    asked = [package for package in packages if "skip_reason" not in package]
    if not asked:
        return Outcome(f"Python: {NO_ANSWER}")
    weaknesses = list(_weaknesses(asked))
    unknown = len(packages) - len(asked)
    rest = f", {unknown} unknown to it" if unknown else ""
    if weaknesses:
        return Outcome("\n".join(["Python: weaknesses are known:", *weaknesses]), weak=True)
    return Outcome(f"Python: {len(asked)} packages asked about{rest}, no weakness known")


def _weaknesses(packages: list[dict[str, Any]]) -> Iterator[str]:
    for package in packages:
        for weakness in package.get("vulns", []):
            names = {weakness["id"], *weakness.get("aliases", [])}
            if not names & set(ACCEPTED):
                fixed = ", ".join(weakness.get("fix_versions", [])) or "nothing yet"
                yield f"  {package['name']} {package['version']}: {weakness['id']}, fixed in {fixed}"


def npm_outcome(answer: str) -> Outcome:
    """From what `npm audit --json` prints."""
    report = _json(answer)
    if report is None or "vulnerabilities" not in report:
        return Outcome(f"npm: {NO_ANSWER}")
    weaknesses = [
        f"  {name}: {weakness['severity']}" for name, weakness in sorted(report["vulnerabilities"].items())
    ]
    if weaknesses:
        return Outcome("\n".join(["npm: weaknesses are known (details: npm audit):", *weaknesses]), weak=True)
    return Outcome("npm: no weakness known")


def _json(answer: str) -> dict[str, Any] | None:
    try:
        report = json.loads(answer)
    except ValueError:
        return None
    return report if isinstance(report, dict) else None


def _answer(command: list[str], folder: Path) -> str:
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=LONGEST_S
        )
    except subprocess.TimeoutExpired:
        return ""
    return done.stdout


def main() -> int:
    outcomes = [python_outcome(_answer([sys.executable, *PIP_AUDIT.split()], ROOT))]
    if npm := shutil.which("npm"):
        outcomes.append(npm_outcome(_answer([npm, "audit", "--omit=dev", "--json"], ROOT / "frontend")))
    else:
        outcomes.append(Outcome("npm: skipped: there is no npm"))
    print("\n".join(f"audit: {outcome.said}" for outcome in outcomes))
    return int(any(outcome.weak for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
