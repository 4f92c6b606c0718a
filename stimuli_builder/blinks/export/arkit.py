"""Curves as an ARKit blend-shape CSV, the layout the Live Link Face app records."""

from stimuli_builder.blinks.export.curve import AnimationCurve

# fmt: off
BLEND_SHAPES = (
    "EyeBlinkLeft", "EyeLookDownLeft", "EyeLookInLeft", "EyeLookOutLeft", "EyeLookUpLeft", "EyeSquintLeft",
    "EyeWideLeft", "EyeBlinkRight", "EyeLookDownRight", "EyeLookInRight", "EyeLookOutRight", "EyeLookUpRight",
    "EyeSquintRight", "EyeWideRight", "JawForward", "JawRight", "JawLeft", "JawOpen", "MouthClose",
    "MouthFunnel", "MouthPucker", "MouthRight", "MouthLeft", "MouthSmileLeft", "MouthSmileRight",
    "MouthFrownLeft", "MouthFrownRight", "MouthDimpleLeft", "MouthDimpleRight", "MouthStretchLeft",
    "MouthStretchRight", "MouthRollLower", "MouthRollUpper", "MouthShrugLower", "MouthShrugUpper",
    "MouthPressLeft", "MouthPressRight", "MouthLowerDownLeft", "MouthLowerDownRight", "MouthUpperUpLeft",
    "MouthUpperUpRight", "BrowDownLeft", "BrowDownRight", "BrowInnerUp", "BrowOuterUpLeft",
    "BrowOuterUpRight", "CheekPuff", "CheekSquintLeft", "CheekSquintRight", "NoseSneerLeft",
    "NoseSneerRight", "TongueOut", "HeadYaw", "HeadPitch", "HeadRoll", "LeftEyeYaw", "LeftEyePitch",
    "LeftEyeRoll", "RightEyeYaw", "RightEyePitch", "RightEyeRoll",
)
# fmt: on


def to_arkit(curve: AnimationCurve) -> str:
    """EyeBlinkLeft and EyeBlinkRight carry the closures, other shapes stay 0; time is HH:MM:SS:FF.mmm."""
    left, right = BLEND_SHAPES.index("EyeBlinkLeft"), BLEND_SHAPES.index("EyeBlinkRight")
    lines = [",".join(["Timecode", "BlendShapeCount", *BLEND_SHAPES])]
    for frame in range(curve.left.size):
        values = ["0"] * len(BLEND_SHAPES)
        values[left], values[right] = f"{curve.left[frame]:.6f}", f"{curve.right[frame]:.6f}"
        lines.append(",".join([timecode(frame, curve.fps), str(len(BLEND_SHAPES)), *values]))
    return "\n".join(lines) + "\n"


def timecode(frame: int, fps: float) -> str:
    """HH:MM:SS:FF.mmm, the last part thousandths of a frame (they matter at fractional rates)."""
    seconds = int(frame / fps + 1e-9)
    within = max(0.0, frame - seconds * fps)
    whole = int(within + 1e-9)
    thousandths = min(999, round(max(0.0, within - whole) * 1000))
    clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f"{clock}:{whole:02d}.{thousandths:03d}"
