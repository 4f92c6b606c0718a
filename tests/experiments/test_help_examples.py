"""Examples in `--help` are lines that a shell takes as they are printed."""

import inspect
import re
import shlex
from importlib import import_module

import pytest
import typer

from experiments.command_groups import broken, commands_of, whole_examples

PROGRAMS = ("stimuli", "server", "analysis")
MODULES = {"stimuli": "stimuli_builder.cli", "server": "server.cli", "analysis": "analysis.cli"}
WIDTH = 78


def commands(program):
    """Every command of a program with its path, groups included."""
    module = import_module(MODULES[program])
    root = typer.main.get_command(module.app)
    for name in {name for name, _ in getattr(module, "COMMANDS", {}).values()}:
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
