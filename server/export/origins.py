"""Whose data an export holds: one origin, or all of them where they are asked for."""

from typing import Literal, get_args

ExportOrigin = Literal["participant", "pilot", "simulated", "all"]
"""Previews are in no export: they are stored for a day only."""
EXPORTED = get_args(ExportOrigin)[:-1]
