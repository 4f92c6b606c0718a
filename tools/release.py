"""Everything of a release in dist/: wheel, sdist, bill of materials, checksums and release notes.

    make release

First a test upgrades the data of the previous release. Nothing is published; docs/how-to/release.md says how.
"""

import hashlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST = ROOT / "dist"
UPGRADE_TEST = "tests/server/operations/test_upgrade_from_0_1_0.py"


def release_notes(version: str) -> str:
    """The version's part of CHANGELOG.md."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    section = re.search(rf"^## {re.escape(version)}.*?(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    if section is None:
        sys.exit(f"error: CHANGELOG.md has no section for {version}")
    return section[0].rstrip() + "\n"


def main() -> int:
    """Test the upgrade, build, and write notes and checksums."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    notes = release_notes(version)
    subprocess.run([sys.executable, "-m", "pytest", "-q", "-n", "0", UPGRADE_TEST], cwd=ROOT, check=True)
    for tool in ("build_wheel.py", "sbom.py"):
        subprocess.run([sys.executable, f"tools/{tool}"], cwd=ROOT, check=True)
    (DIST / f"release-notes-{version}.md").write_text(notes, encoding="utf-8")
    files = sorted(file for file in DIST.iterdir() if version in file.name or file.name == "sbom.cdx.json")
    sums = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in files]
    (DIST / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
    print("".join(sums), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
