"""Write the reference of commands and of the HTTP API from the programs, before Sphinx reads its sources."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from typer.main import get_command

ANALYSIS = Path(__file__).parents[2] / "analysis"
PROGRAMS = ("stimuli", "server", "analysis")
MODULES = {"stimuli": "stimuli_builder.cli", "server": "server.cli", "analysis": "analysis.cli"}

PRINT_OPENAPI = (
    "import json; from server.app import create_app; from server.core.settings import Settings; "
    "print(json.dumps(create_app(Settings()).openapi()))"
)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("builder-inited", write_references)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_references(app: Sphinx) -> None:
    """Write the pages into reference/generated, each only where it changed."""
    folder = Path(app.srcdir) / "reference" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    for program in PROGRAMS:
        _write(folder / f"{program}.md", "\n".join(command_page(program)))
    _write(folder / "http-api.md", "\n".join(api_page()))
    write_replications(folder / "replications.md")


def write_replications(file: Path) -> None:
    """Rebuild the published studies, unless the page is of the same code and data."""
    sources = sorted(
        path for path in ANALYSIS.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    )
    inputs = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    if file.is_file() and inputs in file.read_text(encoding="utf-8"):
        return
    with tempfile.TemporaryDirectory() as out:
        # In another process: the commands may leave their own settings.
        command = [sys.executable, "-c", "from analysis.cli import main; main()", "replicate", "--out", out]
        subprocess.run(command, check=True, capture_output=True, cwd=ANALYSIS.parent)
        tables = (Path(out) / "comparison.md").read_text(encoding="utf-8")
    said = "Made by `analysis replicate` from the raw files ([how](../../how-to/replicate-studies.md))."
    _write(file, f"# Published studies\n\n<!-- {inputs} -->\n\n{said}\n\n{tables}")


def _write(file: Path, text: str) -> None:
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def command_page(program: str) -> Iterator[str]:
    """One program's commands: the text of `--help` with a table of options."""
    module = __import__(MODULES[program], fromlist=["app"])
    root = get_command(module.app)
    yield f"# `{program}`"
    yield ""
    yield from _help(root)
    yield from _commands(root, root.context_class(root, info_name=program))


def _commands(group: Any, context: Any) -> Iterator[str]:
    if not hasattr(group, "get_command"):
        return
    for name in group.list_commands(context):
        # Resolving loads the command: what get_command gives is a stub without options.
        _, command, _ = group.resolve_command(context, [name])
        if command.hidden:
            continue
        below = command.context_class(command, info_name=name, parent=context)
        yield f"## `{below.command_path}`"
        yield ""
        yield from _help(command)
        if hasattr(command, "get_command"):
            yield from _commands(command, below)
        else:
            yield from _options(command, below)


def _help(command: Any) -> Iterator[str]:
    """The help text; examples and blocks marked by click become code."""
    for paragraph in re.split(r"\n\s*\n", (command.help or "").replace("\f", "").strip()):
        lines = [line for line in paragraph.splitlines() if line.strip() != "\b"]
        if lines and all(line.startswith("  ") for line in lines):
            yield "```sh"
            yield from (line.strip() if not line.strip().startswith("-") else line[2:] for line in lines)
            yield "```"
        else:
            yield escaped(" ".join(line.strip() for line in lines))
        yield ""


def _options(command: Any, context: Any) -> Iterator[str]:
    rows = []
    for parameter in command.get_params(context):
        if parameter.param_type_name == "argument":
            metavar = (parameter.metavar or parameter.name or "").strip("{}").upper()
            rows.append((f"`{metavar}`", str(getattr(parameter, "help", "") or "")))
        elif not parameter.hidden:
            names = ", ".join(f"`{name}`" for name in [*parameter.opts, *parameter.secondary_opts])
            default = parameter.default
            said = parameter.help or ""
            if default not in (None, False, "", ()) and not callable(default):
                values = default if isinstance(default, list | tuple) else [default]
                said += f" Default: `{' '.join(str(value) for value in values)}`."
            rows.append((names, said))
    if rows:
        yield "| argument or option | meaning |"
        yield "|---|---|"
        for names, said in rows:
            yield f"| {names} | {cell(said)} |"
        yield ""


def escaped(text: str) -> str:
    """Markdown that shows the text as it is: angle brackets, stars and dollars mean nothing."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(
        piece if piece.startswith("`") else re.sub(r"([\\<>*_$\[\]{}])", r"\\\1", piece) for piece in pieces
    )


def cell(text: str) -> str:
    """A cell of a table."""
    return escaped(" ".join(text.split())).replace("|", "\\|")


def api_page() -> Iterator[str]:
    """Every endpoint of the server by tag."""
    # In a separate process with a temporary data folder, because settings come from the environment.
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", PRINT_OPENAPI],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PALPEBRA_DATA_FOLDER": folder},
        )
    document: dict[str, Any] = json.loads(done.stdout)
    yield "# HTTP API"
    yield ""
    yield (
        "Every server has the same description in OpenAPI at `/api/openapi.json`. Programs sign in with an "
        "API token (`Authorization: Bearer ...`), which you create on the page *My account*."
    )
    yield ""
    by_tag: dict[str, list[tuple[str, str, dict[str, Any]]]] = {}
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            by_tag.setdefault((operation.get("tags") or ["other"])[0], []).append(
                (method.upper(), path, operation)
            )
    for tag in sorted(by_tag):
        yield f"## {tag}"
        yield ""
        yield "| endpoint | what it does |"
        yield "|---|---|"
        for method, path, operation in by_tag[tag]:
            said = operation.get("description") or operation.get("summary") or ""
            yield f"| `{method} {path}` | {cell(said.split(chr(10) * 2)[0])} |"
        yield ""
