"""Bill of materials of what a server runs (CycloneDX 1.6) and licenses of its parts, from the lock files.

Fails on a license that the GPL 3 cannot be joined with, and on a part of which none is known.
"""

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "dist" / "sbom.cdx.json"
PYTHON_LOCKS = (ROOT / "requirements.lock", ROOT / "deploy/s3.lock")
NPM_LOCK = ROOT / "frontend/package-lock.json"
COMPATIBLE = re.compile(
    r"\b(MIT|BSD|0BSD|Apache|ISC|PSF|Python Software Foundation|MPL|Mozilla|LGPL|Lesser General|GPL-3|GPLv3|"
    r"GPL-2\.0-or-later|GPLv2\+|Unlicense|Zlib|HPND|CC0|BlueOak|OFL|BSL|Boost|Public Domain)\b",
    re.IGNORECASE,
)
"""Families of licenses that may be joined with GPL-3.0-or-later, as packages write them."""
MAX_SAID = 60
"""Longer texts in the field are the license itself, not its name."""
KNOWN = {
    "pyrage": "MIT",
    "questplus": "GPL-3.0",
}
"""Licenses of parts whose metadata say nothing useful, looked up in their sources."""


@dataclass(frozen=True)
class Part:
    """One locked package."""

    ecosystem: str
    name: str
    version: str
    licence: str | None

    @property
    def is_compatible(self) -> bool:
        """Whether its license may be joined with ours; False where none is known."""
        return self.licence is not None and bool(COMPATIBLE.search(self.licence))


def python_lock() -> str:
    """The pins of every package of a server."""
    return "".join(lock.read_text(encoding="utf-8") for lock in PYTHON_LOCKS)


def python_parts(lock: str) -> Iterator[Part]:
    """Every package of a lock file; those of other systems are not installed here and left out."""
    for name, version in re.findall(r"^([A-Za-z0-9._-]+)(?:\[[^]]*\])?==([^\s;\\]+)", lock, re.MULTILINE):
        try:
            told = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            continue
        yield Part("pypi", name, version, KNOWN.get(name) or _licence_of(told))


def _licence_of(told: Any) -> str | None:
    """What a package says of its license: the expression, a short text, or the classifiers."""
    if expression := told.get("License-Expression"):
        return str(expression)
    classifiers = [
        line.rsplit(" :: ", 1)[-1]
        for line in told.get_all("Classifier") or []
        if line.startswith("License :: ") and not line.endswith("OSI Approved")
    ]
    if classifiers:
        return " OR ".join(classifiers)
    text = (told.get("License") or "").strip()
    first = text.splitlines()[0] if text else ""
    return first[:MAX_SAID] or None


def npm_parts(lock: str) -> Iterator[Part]:
    """Every package that reaches a browser."""
    for path, entry in json.loads(lock)["packages"].items():
        if path and not entry.get("dev") and not entry.get("link"):
            name = path.rsplit("node_modules/", 1)[-1]
            yield Part("npm", name, entry["version"], entry.get("license"))


def bill(parts: list[Part]) -> str:
    """The bill of materials as CycloneDX JSON."""
    from cyclonedx.contrib.license.factories import LicenseFactory
    from cyclonedx.model.bom import Bom
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.output.json import JsonV1Dot6
    from packageurl import PackageURL

    licences, bom = LicenseFactory(), Bom()
    bom.metadata.component = Component(
        name="palpebra",
        version=metadata.version("palpebra"),
        type=ComponentType.APPLICATION,
        bom_ref="palpebra",
        licenses=[licences.make_from_string("GPL-3.0-or-later")],
    )
    for part in parts:
        group, _, name = part.name.rpartition("/")
        url = PackageURL(part.ecosystem, group or None, name, part.version)
        bom.components.add(
            Component(
                name=name,
                group=group or None,
                version=part.version,
                bom_ref=str(url),
                purl=url,
                licenses=[licences.make_from_string(part.licence)] if part.licence else [],
            )
        )
    bom.register_dependency(bom.metadata.component, bom.components)
    return str(JsonV1Dot6(bom).output_as_string(indent=2))


def locked_parts() -> list[Part]:
    """Every part of a server and its pages."""
    return [
        *python_parts(python_lock()),
        *npm_parts(NPM_LOCK.read_text(encoding="utf-8")),
    ]


def main() -> int:
    """Say which licenses there are; with `--check` alone, write nothing."""
    parts = locked_parts()
    wrong = [part for part in parts if not part.is_compatible]
    for part in wrong:
        print(
            f"licenses: {part.name} {part.version}: expected a license that goes with GPL-3.0-or-later, got "
            f"{part.licence or 'none'}; leave the package out, or add what its source says to tools/sbom.py"
        )
    counted = {part.ecosystem: sum(p.ecosystem == part.ecosystem for p in parts) for part in parts}
    print(
        "licenses: "
        + ", ".join(f"{number} packages of {name}" for name, number in counted.items())
        + ("" if wrong else ", all go with GPL-3.0-or-later")
    )
    if "--check" not in sys.argv[1:]:
        OUT.parent.mkdir(exist_ok=True)
        OUT.write_text(bill(parts), encoding="utf-8")
        for part in sorted(parts, key=lambda part: part.name):
            print(f"  {part.name} {part.version}: {part.licence or 'unknown'}")
        print(f"written: {OUT.relative_to(ROOT)}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
