"""Do the steps of the Dockerfile in a clean folder, where there is no Docker engine.

Each stage gets a separate folder for its file system; COPY copies, RUN runs there with this machine's
shell, Python and Node in the place of the base image's. USER, HEALTHCHECK and volumes are not tried.
At the end the last stage's ENTRYPOINT is run with `--help` and `database upgrade` on an empty data folder.

    python tools/dockerfile_steps.py [FOLDER]
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@dataclass
class Step:
    """One instruction."""

    word: str
    text: str

    @property
    def stage(self) -> str:
        """The stage that a COPY takes from; empty: the repository."""
        flags = [word for word in shlex.split(self.text) if word.startswith("--from=")]
        return flags[0].removeprefix("--from=") if flags else ""

    @property
    def words(self) -> list[str]:
        """The arguments without flags."""
        return [word for word in shlex.split(self.text) if not word.startswith("--")]

    @property
    def sources(self) -> list[str]:
        """What a COPY copies."""
        return self.words[:-1]


@dataclass
class Stage:
    """A FROM and what follows."""

    image: str
    name: str
    steps: list[Step] = field(default_factory=list)


def parse(text: str) -> list[Stage]:
    """The stages of a Dockerfile."""
    stages: list[Stage] = []
    for line in text.splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        word, rest = line.split(maxsplit=1)
        if word == "FROM":
            image, *name = rest.split()
            stages.append(Stage(image, name[-1] if name else "last"))
        else:
            stages[-1].steps.append(Step(word, rest))
    return stages


def inside(root: Path, folder: Path, name: str) -> Path:
    """Where a path of the image lies."""
    return root / name.lstrip("/") if name.startswith("/") else folder / name


def copy(step: Step, roots: dict[str, Path], root: Path, folder: Path) -> None:
    """COPY: of folders the content, as Docker does it."""
    target = inside(root, folder, step.words[-1])
    for source in step.sources:
        copied = inside(roots[step.stage], roots[step.stage], source) if step.stage else ROOT / source
        if copied.is_dir():
            left = shutil.ignore_patterns("node_modules", "dist", "__pycache__") if not step.stage else None
            shutil.copytree(copied, target, ignore=left, symlinks=True, dirs_exist_ok=True)
        else:
            into_folder = step.words[-1].endswith("/") or len(step.sources) > 1
            (target if into_folder else target.parent).mkdir(parents=True, exist_ok=True)
            shutil.copy2(copied, target / copied.name if into_folder else target)


def play(stage: Stage, roots: dict[str, Path], base: Path) -> tuple[Path, dict[str, str]]:
    """Do a stage; return its working folder and environment."""
    root = roots[stage.name] = base / stage.name
    folder, environment = root, {**os.environ}
    for step in stage.steps:
        began = time.monotonic()
        if step.word == "WORKDIR":
            folder = inside(root, root, step.text)
            folder.mkdir(parents=True, exist_ok=True)
        elif step.word == "COPY":
            copy(step, roots, root, folder)
        elif step.word == "ENV":
            for pair in shlex.split(step.text):
                name, value = pair.split("=", 1)
                here = value.replace("/app", str(root / "app"))
                environment[name] = here.replace("$PATH", environment["PATH"])
        elif step.word == "RUN":
            subprocess.run(step.text, shell=True, cwd=folder, env=environment, check=True)
        else:
            continue
        print(f"{stage.name}: {step.word} {step.text[:70]} ({time.monotonic() - began:.0f} s)", flush=True)
    return folder, environment


def main() -> int:
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    base = given or Path(tempfile.mkdtemp(prefix="palpebra-image-"))
    stages = parse((ROOT / "Dockerfile").read_text(encoding="utf-8"))
    roots: dict[str, Path] = {}
    try:
        for stage in stages:
            folder, environment = play(stage, roots, base)
        [entry] = [json.loads(step.text) for step in stages[-1].steps if step.word == "ENTRYPOINT"]
        for arguments in (["--help"], ["database", "upgrade"]):
            # By its full path: where PATH is changed for the child, the parent's own would be searched.
            program = shutil.which(entry[0], path=environment["PATH"])
            subprocess.run([str(program), *entry[1:], *arguments], cwd=folder, env=environment, check=True)
    except subprocess.CalledProcessError as error:
        print(f"failed: {error.cmd} (code {error.returncode})")
        return 1
    finally:
        if given is None:
            shutil.rmtree(base, ignore_errors=True)
    print("every step of the Dockerfile worked")
    return 0


if __name__ == "__main__":
    sys.exit(main())
