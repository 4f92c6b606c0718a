"""How command lines are grouped, listed and loaded, with examples that can be pasted into a shell."""

import inspect
import re
from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

# Examples in the help of a command, as lines that can be pasted into a shell.

CONTINUED = " \\"
INDENT = "    "
_BEFORE_OPTION = re.compile(r" (?=--?[a-z])")
_BESIDE_ITS_WORD = re.compile(r"\n?^Example: (.+)(?=\n\n|\Z)", re.MULTILINE)


def whole_examples(text: str, width: int) -> str:
    """Break the examples of a help text before options, so that no line exceeds `width` if possible.

    Parameters
    ----------
    text : str
        A help text; an example is an indented paragraph of one line, or the text after `Example: `.
    width : int
        Characters in a line.

    Returns
    -------
    str
        The text; each example is preceded by click's mark for a paragraph that is not wrapped.
    """
    # Within a paragraph, click would wrap it as prose.
    paragraphs = _BESIDE_ITS_WORD.sub(r"\n\nExample:\n\n  \1", text.strip()).split("\n\n")
    return "\n\n".join(
        _whole(one, width) if one.startswith("  ") and "\n" not in one.strip() else one for one in paragraphs
    )


def _whole(example: str, width: int) -> str:
    indent = "  "
    command, mark, comment = example.strip().partition(" # ")
    lines = broken(command.strip(), width - len(indent))
    if mark:
        beside = f"{lines[-1]}  # {comment.strip()}"
        fits = len(indent + beside) <= width
        lines = [*lines[:-1], beside] if fits else [f"# {comment.strip()}", *lines]
    return "\b\n" + "\n".join(indent + line for line in lines)


def broken(command: str, width: int) -> list[str]:
    """A command as lines that end in a backslash except for the last, broken before options.

    Parameters
    ----------
    command : str
    width : int
        Characters in a line, including the backslash.

    Returns
    -------
    list of str

    Examples
    --------
    >>> broken("stimuli build exp1 --out clips --preview", 28)
    ['stimuli build exp1 \\\\', '    --out clips --preview']
    """
    if len(command) <= width:
        return [command]
    first, *options = _BEFORE_OPTION.split(command)
    lines = [first]
    for number, option in enumerate(options, start=1):
        longer = f"{lines[-1]} {option}"
        room = width if number == len(options) else width - len(CONTINUED)
        if len(longer) <= room:
            lines[-1] = longer
        else:
            lines.append(INDENT + option)
    return [*(line + CONTINUED for line in lines[:-1]), lines[-1]]


# How the commands of every command line are gathered and listed in its help.

NEAR = 0.7
"""Minimum similarity for suggesting a command: with less, `blinks` would be suggested for `list`."""


class WholeExamplesCommand(TyperCommand):
    """A command whose examples can be pasted from its help; Typer would break them within an option.

    An option that takes one value is refused when it is given twice: Typer would ignore the first.
    """

    def make_parser(self, ctx: Any) -> Any:
        """Make the parser, which names an option given twice."""
        parser = super().make_parser(ctx)
        parse = parser.parse_args

        def parse_once(args: list[str]) -> Any:
            options, arguments, order = parse(args)
            _refuse_twice(ctx, order)
            return options, arguments, order

        parser.parse_args = parse_once  # type: ignore[method-assign]
        return parser

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """Write the help, its examples broken before options as a shell reads them."""
        given = self.help
        self.help = whole_examples(
            inspect.cleandoc(given or ""), formatter.width - formatter.indent_increment
        )
        super().format_help_text(ctx, formatter)
        self.help = given


def _refuse_twice(ctx: Any, given: list[Any]) -> None:
    for option in given:
        if option.param_type_name != "option" or option.multiple or option.is_flag or option.count:
            continue
        if given.count(option) > 1:
            name = option.opts[0]
            commas = f" Separate several by commas: {name} a,b." if "commas" in (option.help or "") else ""
            ctx.fail(f"{name} is given {given.count(option)} times; give it once.{commas}")


class CommandApp(typer.Typer):
    """An app whose commands are `WholeExamplesCommand`."""

    def command(self, name: str | None = None, **settings: Any) -> Any:
        """Add a command, as Typer's own."""
        return super().command(name, **{"cls": WholeExamplesCommand, **settings})


class WholeLineGroup(TyperGroup):
    """A group whose help lists each command with its whole first paragraph; Typer would shorten it."""

    def __init__(self, **settings: Any):
        super().__init__(**{**settings, "suggest_commands": False})

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command; for an unknown one, suggest commands with similar names."""
        lacks = args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None
        if lacks and not ctx.resilient_parsing:
            near = get_close_matches(args[0], self.list_commands(ctx), cutoff=NEAR)
            hint = f" Did you mean {', '.join(map(repr, near))}?" if near else ""
            ctx.fail(f"There is no command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the section of the help that lists the commands."""
        for command in self.commands.values():
            paragraph = (command.help or "").strip().split("\n\n")[0]
            command.short_help = command.short_help or " ".join(paragraph.split())
        super().format_commands(ctx, formatter)


def command_group(
    help_text: str, *, group_class: type[WholeLineGroup] = WholeLineGroup, **settings: Any
) -> typer.Typer:
    """A Typer app whose help is plain text.

    Rich's help takes as long to import as all the rest of `--help`, and breaks its columns into words at 80
    characters.

    Parameters
    ----------
    help_text : str
        Purpose of the commands: the first paragraph of the group's help.
    group_class : type
        Class of the group: `WholeLineGroup` or one made of it.
    **settings : Any
        Further settings of `typer.Typer`.

    Returns
    -------
    typer.Typer
        An app to which commands and groups are added.
    """
    settings = {"no_args_is_help": True, **settings}
    return CommandApp(
        help=help_text, cls=group_class, rich_markup_mode=None, pretty_exceptions_enable=False, **settings
    )


# A command line that lists its commands without importing them: each is loaded when it is called.

Commands = Mapping[str, tuple[str, str]]
"""Command -> the module whose `register` adds it, and its line of help in the list (hidden where empty)."""


def lazy_group(commands: Commands) -> type[WholeLineGroup]:
    """A class of groups that have these commands."""

    class LazyGroup(WholeLineGroup):
        """Imports a command's module when the command is called; its line in `--help` needs no import."""

        def __init__(self, **settings: Any):
            super().__init__(**settings)
            self._unloaded = set(commands)
            self.commands = {
                name: TyperCommand(name, help=line, hidden=not line) for name, (_, line) in commands.items()
            }

        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            """Load the module of the command that is called."""
            if args and args[0] in self._unloaded:
                loaded = commands_of(commands[args[0]][0])
                self.commands.update(loaded)
                self._unloaded -= set(loaded)
            return super().resolve_command(ctx, args)

    return LazyGroup


def commands_of(module: str) -> dict[str, Any]:
    """The commands that a module registers, by name."""
    part = command_group("", add_completion=False)
    import_module(module).register(part)
    return dict(typer.main.get_group(part).commands)


def lazy_app(name: str, summary: str, commands: Commands) -> typer.Typer:
    """The app of a command line with these commands."""
    app = command_group(summary, name=name, group_class=lazy_group(commands))
    # Typer makes no group where neither a command nor this is registered.
    app.callback()(lambda: None)
    return app
