"""The help of each program: examples that a shell takes as printed, and a list that imports no library."""

import inspect
import re
import shlex
import subprocess
import sys
from importlib import import_module

import pytest
import typer

from experiments.command_groups import broken, commands_of, whole_examples

PROGRAMS = ("stimuli", "server", "analysis")
MODULES = {"stimuli": "stimuli_builder.cli", "server": "server.cli", "analysis": "analysis.cli"}
WIDTH = 78
HEAVY = (
    *("numpy", "scipy", "pandas", "av", "cv2", "matplotlib", "numba", "skia", "pydantic"),
    *("sqlalchemy", "fastapi", "authlib", "httpx", "uvicorn", "alembic", "server.core.settings"),
)
HELP = """
import sys
from {module} import main
sys.argv = ["{program}", "--help"]
try:
    main()
finally:
    sys.stderr.write(" ".join(name for name in {heavy} if name in sys.modules))
"""


def listed_by(program):
    """The commands that a program lists, each with its module and its line of help."""
    return import_module(MODULES[program]).COMMANDS


def commands(program):
    """Every command of a program with its path, groups included."""
    module = import_module(MODULES[program])
    root = typer.main.get_command(module.app)
    for name in {name for name, _ in module.COMMANDS.values()}:
        root.commands.update(commands_of(name))
    waiting = [(program, root)]
    while waiting:
        path, command = waiting.pop()
        yield path, command
        waiting += [(f"{path} {name}", one) for name, one in getattr(command, "commands", {}).items()]


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_example_can_be_pasted(program, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    seen = 0
    for path, command in commands(program):
        with command.context_class(command, info_name=path) as context:
            printed = command.get_help(context)
        joined = [
            " ".join(shlex.split(line))
            for line in printed.replace("\\\n", " ").splitlines()[1:]
            if f"{program} " in line and line.startswith("    ")
        ]
        examples = examples_of(command.help or "", program)
        for example in examples:
            assert any(" ".join(shlex.split(example)) == line.partition(" # ")[0] for line in joined), example
        seen += len(examples)
        for line in printed.partition("\nOptions:")[0].splitlines()[1:]:
            assert len(line) <= WIDTH, f"{path}: {line}"
    assert seen > 10


@pytest.mark.parametrize(
    ("program", "module"),
    [(name, one) for name in PROGRAMS for one in sorted({home for home, _ in listed_by(name).values()})],
)
def test_every_line_of_help_is_the_one_of_the_command_itself(program, module):
    lines = {
        name: "" if command.hidden else " ".join((command.help or "").strip().split("\n\n")[0].split())
        for name, command in commands_of(module).items()
    }
    assert lines == {name: line for name, (home, line) in listed_by(program).items() if home == module}


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_lists_every_command_and_imports_none_of_their_libraries(program):
    asked = HELP.format(program=program, module=MODULES[program], heavy=HEAVY)
    ended = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert ended.stderr == ""
    section = ended.stdout.split("Commands:\n")[1]
    listed = [line.split(maxsplit=1)[0] for line in section.splitlines() if line[2:3].strip()]
    assert listed == [name for name, (_, line) in listed_by(program).items() if line]
    assert "..." not in section  # every line whole


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_command_has_an_example(program):
    """A group's own line lists its commands."""
    alone = ((path, command) for path, command in commands(program) if not hasattr(command, "commands"))
    assert [path for path, command in alone if not examples_of(command.help or "", program)] == []


def examples_of(text, program):
    """The lines that a command's help gives to be pasted."""
    examples = [one.strip().partition(" # ")[0] for one in text.split("\n\n") if is_example(one, program)]
    return examples + re.findall(r"^Example: (.+)$", inspect.cleandoc(text), re.MULTILINE)


def is_example(paragraph, program):
    return bool(re.match(rf" +{program} ", paragraph.strip("\n"))) and "\n" not in paragraph.strip()


def test_a_command_is_broken_before_options():
    assert broken("stimuli build exp1 --out clips --preview", 28) == [
        "stimuli build exp1 \\",
        "    --out clips --preview",
    ]


@pytest.mark.parametrize(
    ("comment", "expected"),
    [
        ("short", "  a bc --long value \\\n      --more x  # short"),
        (
            "a comment too long to fit",
            "  # a comment too long to fit\n  a bc --long value \\\n      --more x",
        ),
    ],
)
def test_a_comment_never_swallows_the_rest_of_its_command(comment, expected):
    text = f"What it is.\n\n  a bc --long value --more x   # {comment}"
    assert whole_examples(text, 27) == f"What it is.\n\n\b\n{expected}"


def test_an_example_behind_its_word_gets_lines_of_its_own():
    text = "What it is.\nExample: a bc --long value --more x"
    expected = "What it is.\n\nExample:\n\n\b\n  a bc --long value \\\n      --more x"
    assert whole_examples(text, 27) == expected
