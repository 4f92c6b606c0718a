"""Curves as a Maya .anim file, to import with the animImportExport plug-in."""

from experiments.errors import InputError
from stimuli_builder.blinks.export.curve import AnimationCurve
from stimuli_builder.blinks.profile import Array

_NAMED_UNITS = {15: "game", 24: "film", 25: "pal", 30: "ntsc", 48: "show", 50: "palf", 60: "ntscf"}
# fmt: off
_NUMBERED_UNITS = (
    2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 40, 75, 80, 100, 120, 125, 150, 200, 240, 250, 300, 375, 400, 500, 600,
    750,
)
# fmt: on


def time_unit(fps: float) -> str:
    """Maya's name of a frame rate; rates it cannot name are refused."""
    rate = round(fps)
    if abs(rate - fps) < 1e-6 and rate in _NAMED_UNITS:
        return _NAMED_UNITS[rate]
    if abs(rate - fps) < 1e-6 and rate in _NUMBERED_UNITS:
        return f"{rate}fps"
    known = sorted([*_NAMED_UNITS, *_NUMBERED_UNITS])
    near = min(known, key=lambda unit: abs(unit - fps))
    raise InputError(f"Maya has no time unit of {fps:g} frames a second; the nearest is --fps {near}")


def to_maya(
    curve: AnimationCurve, node: str = "face", left: str = "eyeBlinkLeft", right: str = "eyeBlinkRight"
) -> str:
    """One unitless curve an eye on `node`, a key a frame, linear between them."""
    header = [
        "animVersion 1.1;",
        "mayaVersion 2024;",
        f"timeUnit {time_unit(curve.fps)};",
        "linearUnit cm;",
        "angularUnit deg;",
        "startTime 0;",
        f"endTime {curve.left.size - 1};",
    ]
    curves = _anim(node, left, 0, curve.left) + _anim(node, right, 1, curve.right)
    return "\n".join(header + curves) + "\n"


def _anim(node: str, attribute: str, index: int, values: Array) -> list[str]:
    keys = [f"    {frame} {value:.6f} linear linear 1 1 0;" for frame, value in enumerate(values)]
    return [
        f"anim {attribute} {attribute} {node} 0 0 {index};",
        "animData {",
        "  input time;",
        "  output unitless;",
        "  weighted 0;",
        "  preInfinity constant;",
        "  postInfinity constant;",
        "  keys {",
        *keys,
        "  }",
        "}",
    ]
