"""Curves as a USD skeleton animation of blend-shape weights (text form, .usda)."""

import re

from experiments.errors import InputError
from stimuli_builder.blinks.export.curve import AnimationCurve

_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")


def to_usd(
    curve: AnimationCurve, node: str = "face", left: str = "eyeBlinkLeft", right: str = "eyeBlinkRight"
) -> str:
    """Return a layer with one SkelAnimation, /`node`/blinks, to bind to a face as its animation source.

    Raises
    ------
    InputError
        Where `node` is no name that USD takes.
    """
    if not _IDENTIFIER.fullmatch(node):
        raise InputError(
            f"--target '{node}': expected a name of letters, digits and _ that begins with no digit"
        )
    samples = ",\n".join(
        f"                {frame}: [{one:g}, {other:g}]"
        for frame, (one, other) in enumerate(zip(curve.left, curve.right, strict=True))
    )
    return f"""#usda 1.0
(
    defaultPrim = "{node}"
    doc = "Blinks by Palpebra"
    endTimeCode = {curve.left.size - 1}
    framesPerSecond = {curve.fps:g}
    startTimeCode = 0
    timeCodesPerSecond = {curve.fps:g}
)

def SkelRoot "{node}"
{{
    def SkelAnimation "blinks"
    {{
        uniform token[] blendShapes = ["{left}", "{right}"]
        float[] blendShapeWeights.timeSamples = {{
{samples},
        }}
    }}
}}
"""
