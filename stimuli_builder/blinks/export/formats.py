"""Every format a curve can be written in, and the names it writes the eyes under."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.export.arkit import to_arkit
from stimuli_builder.blinks.export.blender import to_blender
from stimuli_builder.blinks.export.curve import AnimationCurve
from stimuli_builder.blinks.export.gltf import to_gltf
from stimuli_builder.blinks.export.maya import to_maya
from stimuli_builder.blinks.export.plain import to_csv, to_json
from stimuli_builder.blinks.export.usd import to_usd

_SAFE_NAME = re.compile(r"[A-Za-z_][\w.:|-]*")


@dataclass(frozen=True)
class CurveTarget:
    """The object (Blender) or node (Maya) that has the shapes, and what each eye's shape is called."""

    name: str = ""
    left: str = "eyeBlinkLeft"
    right: str = "eyeBlinkRight"


FORMATS: Mapping[str, Callable[[AnimationCurve, CurveTarget], str]] = {
    "csv": lambda curve, _: to_csv(curve),
    "json": lambda curve, _: to_json(curve),
    "blender": lambda curve, target: to_blender(curve, target.name, target.left, target.right),
    "maya": lambda curve, target: to_maya(curve, target.name or "face", target.left, target.right),
    "arkit": lambda curve, _: to_arkit(curve),
    "gltf": lambda curve, target: to_gltf(curve, target.name or "face", target.left, target.right),
    "usd": lambda curve, target: to_usd(curve, target.name or "face", target.left, target.right),
}


def check_format(format_name: str, target: CurveTarget, option: str = "--format") -> None:
    """Refuse an unknown format, a name that a program could not take, or one name for both eyes.

    Parameters
    ----------
    option : str
        Which the format is given by.
    """
    if format_name not in FORMATS:
        near = nearest(format_name, FORMATS)
        raise InputError(
            f"unknown {option} '{format_name}'; expected one of: {', '.join(FORMATS)}"
            + (f"; did you mean '{near}'?" if near else "")
        )
    named = {"--left": target.left, "--right": target.right, "--target": target.name or "face"}
    for named_by, name in named.items():
        if not _SAFE_NAME.fullmatch(name):
            raise InputError(f"{named_by} '{name}': expected a name of letters, digits and _ . : | -")
    if target.left == target.right:
        raise InputError(f"--left and --right are both '{target.left}': each eye needs a shape of its own")


def write_curve(format_name: str, curve: AnimationCurve, target: CurveTarget) -> str:
    """Return the curve as text in one of `FORMATS`; refuses what `check_format` refuses."""
    check_format(format_name, target)
    return FORMATS[format_name](curve, target)
