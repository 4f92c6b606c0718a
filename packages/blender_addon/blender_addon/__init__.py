"""Palpebra Blinks: natural blinks in Blender (panel 'Blinks' in the sidebar of the 3D view).

`make addon` builds the zip that Blender installs; it carries the blink engine with it.
"""


def register() -> None:
    """Called by Blender when the add-on is switched on."""
    from blender_addon import operators, panel, settings

    settings.register()
    operators.register()
    panel.register()


def unregister() -> None:
    """Called by Blender when the add-on is switched off."""
    from blender_addon import operators, panel, settings

    panel.unregister()
    operators.unregister()
    settings.unregister()
