"""Run commands, or a probe, of the program in one tree; started with `python launch.py TREE JOB.json`.

This file imports nothing from its tree: the process that runs it must import the program from TREE alone.
In the environment of both sides the program of the working tree is installed (editable); `use_only` takes
that out and `check_origin` proves it.

A job is `{"commands": [...]}`, `{"help": FOLDER}` or `{"probe": NAME, "probes": FILE, "out": FOLDER}`. A
command is `{"program": "server", "arguments": [...], "out": FILE}`: its standard output goes to FILE. All
commands of a job run in one process, one after another, as starting Python takes longer than most of them.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import json
import sys
import tomllib
import traceback
from pathlib import Path
from typing import Any

Job = dict[str, Any]
REFUSED = 2
"""Exit status of a program that refuses its input; with `"refusal": FILE` its message is an output."""


def use_only(tree: Path) -> None:
    """Import the program from this tree alone."""
    sys.path[0:1] = [str(tree), *map(str, sorted(tree.glob("packages/*")))]
    sys.meta_path[:] = [one for one in sys.meta_path if not is_editable(one)]
    sys.path_hooks[:] = [one for one in sys.path_hooks if not is_editable(one)]
    sys.path_importer_cache.clear()


def is_editable(finder: Any) -> bool:
    """Whether an import finder is that of an editable installation."""
    owner = getattr(finder, "__module__", "") or type(finder).__module__
    return str(owner).startswith("__editable__")


def program_packages(tree: Path) -> set[str]:
    """Names of the packages at the top of a tree."""
    return {path.parent.name for path in tree.glob("*/__init__.py")} - {"tests"}


def check_origin(tree: Path) -> None:
    """End the process where a module of the program came from another place than the tree."""
    packages, count = program_packages(tree), 0
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if name.split(".")[0] in packages and file:
            count += 1
            if not Path(file).resolve().is_relative_to(tree):
                sys.exit(f"expected {name} from {tree}, it was imported from {file}")
    if not count:
        sys.exit(f"expected to import the program from {tree}, nothing of it was imported")


def entry_point(tree: Path, program: str) -> Any:
    """The function behind a program's name, as its pyproject.toml says."""
    project = tomllib.loads((tree / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    module, _, function = project["scripts"][program].partition(":")
    return getattr(importlib.import_module(module), function)


def run_command(tree: Path, command: Job) -> None:
    """Run one command; end the process with its output where it fails."""
    program, arguments = command["program"], command["arguments"]
    main = entry_point(tree, program)
    buffers = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)]
    sys.argv = [program, *arguments]
    code: object = 0
    with contextlib.redirect_stdout(buffers[0]), contextlib.redirect_stderr(buffers[1]):
        try:
            main()
        except SystemExit as ended:
            code = ended.code or 0
        except Exception:
            code = traceback.format_exc()
    said, complained = (one.buffer.getvalue() for one in buffers)
    if code == REFUSED and "refusal" in command:
        write_bytes(Path(command["refusal"]), complained)
        return
    if code:
        text = complained.decode(errors="replace")[-2000:] + said.decode(errors="replace")[-1000:]
        sys.exit(f"{program} {' '.join(arguments)}: ended with {code}\n{text}")
    if "out" in command:
        write_bytes(Path(command["out"]), said)


def write_bytes(path: Path, content: bytes) -> None:
    """A file in a folder that is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def write_help(tree: Path, out: Path) -> None:
    """`--help` of every program, command and sub-command, each in a file named by its words."""
    project = tomllib.loads((tree / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    waiting = [[program] for program in sorted(project["scripts"])]
    while waiting:
        words = waiting.pop()
        file = out / f"{' '.join(words)}.txt"
        run_command(tree, {"program": words[0], "arguments": [*words[1:], "--help"], "out": str(file)})
        _, _, listed = file.read_text(encoding="utf-8").partition("\nCommands:\n")
        # A command's name is indented by two, the second line of what it does by more.
        names = [line.split()[0] for line in listed.splitlines() if line[:2] == "  " and line[2:3].strip()]
        waiting += [[*words, name] for name in names]


def main(tree: Path, job: Job) -> None:
    """Run the job."""
    use_only(tree)
    if "help" in job:
        write_help(tree, Path(job["help"]))
    for command in job.get("commands", []):
        run_command(tree, command)
    if "probe" in job:
        specification = importlib.util.spec_from_file_location("probes", job["probes"])
        assert specification is not None
        assert specification.loader is not None
        probes = importlib.util.module_from_spec(specification)
        sys.modules["probes"] = probes
        specification.loader.exec_module(probes)
        getattr(probes, job["probe"])(tree, Path(job["out"]))
    check_origin(tree)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), json.loads(Path(sys.argv[2]).read_text(encoding="utf-8")))
