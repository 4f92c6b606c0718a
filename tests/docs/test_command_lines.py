"""Every command line in the documentation names a command and options that exist."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from analysis.cli import app as analysis
from palpebra.cli import app as palpebra
from palpebra.cli import with_start
from server.cli import app as server
from stimuli_builder.cli import app as stimuli
from tests.conftest import REPOSITORY

APPS = {"stimuli": stimuli, "server": server, "analysis": analysis, "palpebra": palpebra}
PROGRAMS = {program: get_command(app) for program, app in APPS.items()}
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^[ ]*```([^\n`]*)\n(.*?)^[ ]*```[ ]*$", re.MULTILINE | re.DOTALL)
SHELL = {"", "sh", "text", "console"}
INLINE = re.compile(r"(?<!`)`((?:stimuli|server|analysis|palpebra) [^`\n]+)`")
SET = r"(?:[A-Z_]+=\S+ )*"  # variables before a command
COMMAND = re.compile(rf"\s*{SET}(?:(?:stimuli|server|analysis|palpebra) [a-z-]|palpebra\s*(?:#.*)?$)")
# what is between quotation marks, such as a formula with |, stays whole
PIECE = re.compile(r"(?:'[^']*'|[^'|;&]|&(?!&)|'(?![^']*'))+")


@dataclass(frozen=True)
class PrintedLine:
    """What a reader copies at once: a line of a block with what continues it, or code in running text."""

    line: int
    text: str
    inline: bool
    is_cell: bool = False
    """Whether it is all that a cell of a table holds: a command, not the name of one."""

    def commands(self) -> list[str]:
        """The commands of the programs in it, `$(...)` written as X."""
        lines = self.text.replace("\\\n", " ").splitlines()
        pieces = self.text.split("&&") if self.inline else [p for line in lines for p in PIECE.findall(line)]
        return [re.sub(r"\$\([^)]*\)", "X", piece).strip() for piece in pieces if COMMAND.match(piece)]


def printed_lines(text: str) -> list[PrintedLine]:
    """Lines of shell blocks, continued lines and loops joined, and code in running text, in order."""
    printed = []
    for block in BLOCK.finditer(text):
        if block[1].strip() in SHELL:
            begins = text.count("\n", 0, block.start(2)) + 1
            joined = ""
            for number, line in enumerate(block[2].splitlines(), begins):
                first = number - joined.count("\n")
                joined += line.strip()
                if joined.endswith("\\") or (joined.startswith("for ") and joined.split()[-1] != "done"):
                    joined += "\n"
                    continue
                printed.append(PrintedLine(first, joined, inline=False))
                joined = ""
    without_blocks = BLOCK.sub(lambda block: "\n" * block[0].count("\n"), text)
    printed += [
        PrintedLine(
            without_blocks.count("\n", 0, code.start()) + 1,
            code[1],
            inline=True,
            is_cell=without_blocks.endswith("| ", 0, code.start())
            and without_blocks.startswith(" |", code.end()),
        )
        for code in INLINE.finditer(without_blocks)
    ]
    return sorted(printed, key=lambda line: line.line)


def command_lines(text: str) -> list[str]:
    """The commands of a page, in order."""
    return [command for line in printed_lines(text) for command in line.commands()]


def words_of(command: str) -> list[str]:
    """Program, command, options and arguments; `palpebra` alone starts the server."""
    words = shlex.split(re.sub(rf"^{SET}", "", command.strip()).partition(" > ")[0], comments=True)
    return [words[0], *with_start(words[1:])] if words[0] == "palpebra" else words


def fault_of(line: str) -> str | None:
    """What does not exist in a command line, or None."""
    words = words_of(line.replace("...", ""))
    command: Any = PROGRAMS[words[0]]
    context = command.context_class(command, info_name=words[0])
    rest = words[1:]
    while hasattr(command, "get_command") and rest and not rest[0].startswith("-"):
        names = rest[0].split("|")
        if any(command.get_command(context, name) is None for name in names):
            return f"no command {rest[0]!r}"
        # Commands are loaded when they are resolved: what get_command gives is a stub without options.
        _, command, _ = command.resolve_command(context, names[:1])
        rest = rest[1:]
        context = command.context_class(command, info_name=command.name, parent=context)
    known = {
        name
        for parameter in command.get_params(context)
        for name in [*parameter.opts, *parameter.secondary_opts]
    }
    known.add("--help")
    for word in rest:
        option = word.partition("=")[0]
        if re.fullmatch(r"--?[a-z][\w-]*", option) and option not in known:
            return f"{command.name}: no option {option}"
    if any("[" in word or word in ("...", "|") for word in rest):
        return None  # a synopsis, not a command
    *_, extra = _parsed(command, context, rest)
    return f"{command.name}: too many arguments: {' '.join(extra)}" if extra else None


def _parsed(command: Any, context: Any, words: list[str]) -> tuple[Any, list[str]]:
    """Options as given, and the words that no argument of the command takes."""
    if hasattr(command, "get_command"):
        return {}, []
    context.resilient_parsing = True
    options, left, _ = command.make_parser(context).parse_args(list(words))
    return options, left


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_commands_of_page_exist(page: Path) -> None:
    faults = {}
    for line in command_lines(page.read_text(encoding="utf-8")):
        try:
            fault = fault_of(line)
        except ValueError as error:
            fault = str(error)
        if fault:
            faults[line] = fault
    assert not faults


def test_a_wrong_option_is_found() -> None:
    assert fault_of("analysis anova x.csv --witihn a") == "anova: no option --witihn"
    assert fault_of("stimuli blink x.csv") == "no command 'blink'"
    assert fault_of("server workspace member vision anna editor") == "member: too many arguments: editor"
    assert len([line for page in PAGES for line in command_lines(page.read_text(encoding="utf-8"))]) > 150


def leaf_commands(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[Any, tuple[str, ...]]]:
    inner = getattr(command, "commands", None)
    if not inner:
        yield command, path
    for name, one in (inner or {}).items():
        yield from leaf_commands(one, (*path, name))


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_breaks_lines_between_words_only(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A word longer than its column is cut in the middle: `thr eshold=200`. A hyphen may end a line."""
    monkeypatch.setenv("COLUMNS", "80")
    for command, path in leaf_commands(PROGRAMS[program]):
        shown = CliRunner().invoke(APPS[program], [*path, "--help"]).output
        texts = [getattr(option, "help", "") or "" for option in command.params]
        words = [word for text in texts for word in re.split(r"\s+|(?<=-)", text)]
        assert [word for word in words if word not in shown] == [], path
