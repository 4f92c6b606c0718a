"""Build the Blender add-on: one zip that Blender installs, the blink engine inside it (`make addon`)."""

import argparse
import re
import sys
import zipfile
from pathlib import Path

from experiments.files import whole_file

ROOT = Path(__file__).resolve().parents[3]
ADDON, ENGINE = Path(__file__).resolve().parents[1] / "blender_addon", ROOT / "blink_engine"
STAMP = (2026, 1, 1, 0, 0, 0)
"""One date for every entry, so that the same sources give the same bytes."""


def addon_files() -> dict[str, str]:
    """Text of every file of the zip, imports made relative: Blender gives an extension another name."""
    files = {"blender_manifest.toml": _text(ADDON / "blender_manifest.toml")}
    for source in sorted(ADDON.glob("*.py")):
        inside = re.sub(r"\bfrom blender_addon import\b", "from . import", _text(source))
        inside = re.sub(r"\bfrom blender_addon\.", "from .", inside)
        files[source.name] = re.sub(r"\bfrom blink_engine\b", "from .blink_engine", inside)
    for source in sorted(ENGINE.glob("*.py")):
        files[f"blink_engine/{source.name}"] = re.sub(r"\bfrom blink_engine\.", "from .", _text(source))
    files["blink_engine/defaults.json"] = _text(ENGINE / "defaults.json")
    files["LICENSE"] = _text(ROOT / "LICENSE")
    return files


def build(folder: Path) -> Path:
    """Write the zip into a folder; returns its path."""
    version = re.search(r'^version = "([^"]+)"', _text(ADDON / "blender_manifest.toml"), re.MULTILINE)
    if version is None:
        raise SystemExit("blender_manifest.toml names no version")
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"palpebra_blinks-{version.group(1)}.zip"
    with whole_file(target) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in addon_files().items():
            archive.writestr(zipfile.ZipInfo(name, STAMP), text, zipfile.ZIP_DEFLATED)
    return target


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for the zip (dist)")
    sys.stdout.write(
        f"wrote {build(parser.parse_args().out)}: in Blender, Preferences, Add-ons, Install from Disk\n"
    )
