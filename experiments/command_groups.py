"""How the commands of every command line are gathered and listed in its help."""

import inspect
from difflib import get_close_matches
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from experiments.help_examples import whole_examples

NEAR = 0.7
"""Likeness from which a command is suggested: below it `list` is answered with `blinks`."""


class WholeExamplesCommand(TyperCommand):
    """A command whose examples can be pasted from its help; Typer would break them within an option."""

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """Write the help, its examples broken before options as a shell reads them."""
        given = self.help
        self.help = whole_examples(
            inspect.cleandoc(given or ""), formatter.width - formatter.indent_increment
        )
        super().format_help_text(ctx, formatter)
        self.help = given


class CommandApp(typer.Typer):
    """An app whose commands are `WholeExamplesCommand`."""

    def command(self, name: str | None = None, **settings: Any) -> Any:
        """Add a command, as Typer's own."""
        return super().command(name, **{"cls": WholeExamplesCommand, **settings})


class WholeLineGroup(TyperGroup):
    """A group whose help lists each command with its whole first paragraph; Typer would cut it short."""

    def __init__(self, **settings: Any):
        super().__init__(**{**settings, "suggest_commands": False})

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command; one that is not there is answered with those whose names are like it."""
        lacks = args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None
        if lacks and not ctx.resilient_parsing:
            near = get_close_matches(args[0], self.list_commands(ctx), cutoff=NEAR)
            hint = f" Did you mean {', '.join(map(repr, near))}?" if near else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
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
        What the commands are for: the first paragraph of the group's own help.
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
