"""How the commands of every command line are gathered and listed in its help."""

from typing import Any

import typer
from typer.core import TyperGroup


class WholeLineGroup(TyperGroup):
    """A group whose help lists each command with its whole first paragraph; Typer would cut it short."""

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
    return typer.Typer(
        help=help_text, cls=group_class, rich_markup_mode=None, pretty_exceptions_enable=False, **settings
    )
