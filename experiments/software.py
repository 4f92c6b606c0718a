"""What numbers were made with: versions of the interpreter, of the system and of every package in use."""

import platform
import re
from importlib import metadata

from experiments.declaration.base import Declaration

PROGRAM = "palpebra"
_NAME = re.compile(r"^[A-Za-z0-9._-]+")


class Software(Declaration):
    """Versions of everything that a report rests on."""

    python: str
    """Version of Python."""
    system: str
    """Operating system and processor."""
    packages: dict[str, str]
    """Version of each installed package that the program needs, by its normalised name."""


def present_software() -> Software:
    """Of the running process."""
    return Software(
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        packages=dict(sorted(_versions().items())),
    )


def _versions() -> dict[str, str]:
    """The program's packages and theirs, as far as they are installed; optional ones left out."""
    versions: dict[str, str] = {}
    waiting = [PROGRAM]
    while waiting:
        name = waiting.pop()
        if name in versions:
            continue
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:  # for another system
            continue
        versions[name] = distribution.version
        waiting.extend(
            _normalised(needed) for needed in distribution.requires or () if "extra ==" not in needed
        )
    return versions


def _normalised(requirement: str) -> str:
    matched = _NAME.match(requirement)
    return re.sub(r"[-_.]+", "-", matched[0]).lower() if matched else ""


def differences(before: Software, after: Software) -> list[str]:
    """What is not the same, a line each: `matplotlib 3.10.1 became 3.10.8`."""
    lines = [
        f"{name} {was} became {now}"
        for name, was, now in (
            ("Python", before.python, after.python),
            ("system", before.system, after.system),
        )
        if was != now
    ]
    for name in sorted({*before.packages, *after.packages}):
        was, now = before.packages.get(name, "(absent)"), after.packages.get(name, "(absent)")
        if was != now:
            lines.append(f"{name} {was} became {now}")
    return lines
