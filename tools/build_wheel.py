"""Build the demo's clips, then the wheel and the sdist: `make wheel` writes them to dist/.

The wheel that the sdist builds is compared with the first one, file by file.
"""

import hashlib
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST, DEMO = ROOT / "dist", ROOT / "palpebra" / "demo"
DEMO_BYTES_MAX = 3_000_000


def build_demo() -> None:
    """A short Experiment 3: one blink per kind of lower-lid motion, and no repeats."""
    text = (ROOT / "experiments" / "exp3.toml").read_text(encoding="utf-8")
    text = re.sub(r'^name = "exp3"', 'name = "demo"', text, flags=re.MULTILINE)
    text = re.sub(r'^title = ".*"', 'title = "Demo: motion of the lower eyelid"', text, flags=re.MULTILINE)
    text = re.sub(r"^per_cell = \d+", "per_cell = 2", text, flags=re.MULTILINE)
    text = re.sub(r"^repeats = \d+", "repeats = 1", text, flags=re.MULTILINE)
    text = re.sub(r"^trials = \d+", "trials = 2", text, flags=re.MULTILINE)
    for old, new in (("about 20 minutes", "about two minutes"), ("etwa 20 Minuten", "etwa zwei Minuten")):
        text = text.replace(old, new)
    shutil.rmtree(DEMO, ignore_errors=True)
    DEMO.mkdir()
    (DEMO / "demo.toml").write_text(text, encoding="utf-8")
    program = str(Path(sys.executable).parent / "stimuli")
    build = [program, "build", str(DEMO / "demo.toml"), "--out", str(DEMO)]
    subprocess.run([*build, "--quiet-when-current"], cwd=ROOT, check=True)
    size = sum(file.stat().st_size for file in DEMO.rglob("*") if file.is_file())
    if size > DEMO_BYTES_MAX:
        sys.exit(f"error: the demo has {size} bytes, expected at most {DEMO_BYTES_MAX}")


def contents(wheel: Path) -> dict[str, str]:
    """Name -> SHA-256 of each file of a wheel, its own list of files left out."""
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if not name.endswith(("/RECORD", "/"))]
        return {name: hashlib.sha256(archive.read(name)).hexdigest() for name in names}


def main() -> int:
    """Build both and compare."""
    build_demo()
    for old in [*DIST.glob("palpebra-*.whl"), *DIST.glob("palpebra-*.tar.gz")]:
        old.unlink()
    uv = [str(Path(sys.executable).parent / "uv"), "build", "-q"]
    subprocess.run([*uv, "--wheel", "--out-dir", str(DIST), str(ROOT)], check=True)
    subprocess.run([*uv, "--sdist", "--out-dir", str(DIST), str(ROOT)], check=True)
    (wheel,), (sdist,) = DIST.glob("palpebra-*.whl"), DIST.glob("palpebra-*.tar.gz")
    again = ROOT / "build" / "wheel-of-sdist"
    shutil.rmtree(again, ignore_errors=True)
    subprocess.run([*uv, "--wheel", "--out-dir", str(again), str(sdist)], check=True)
    (second,) = again.glob("*.whl")
    if contents(wheel) != contents(second):
        differing = sorted(set(contents(wheel).items()) ^ set(contents(second).items()))
        sys.exit(f"error: the sdist builds another wheel: {differing[:5]}")
    print(f"{wheel.relative_to(ROOT)}: {wheel.stat().st_size / 1e6:.1f} MB; the sdist builds the same")
    return 0


if __name__ == "__main__":
    sys.exit(main())
