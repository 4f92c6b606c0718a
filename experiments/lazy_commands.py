"""A command line that lists its commands without importing any: each is loaded when it is called."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand

from experiments.command_groups import WholeLineGroup, command_group

Commands = Mapping[str, tuple[str, str]]
"""Command -> the module whose `register` adds it, and the line of help that lists it."""


def lazy_group(commands: Commands) -> type[WholeLineGroup]:
    """A class of groups that have these commands."""

    class LazyGroup(WholeLineGroup):
        """Imports a command's module when the command is called; its line in `--help` needs no import."""

        def __init__(self, **settings: Any):
            super().__init__(**settings)
            self._unloaded = set(commands)
            self.commands = {name: TyperCommand(name, help=line) for name, (_, line) in commands.items()}

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
