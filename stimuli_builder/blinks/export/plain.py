"""Curves as CSV and JSON."""

import json

from stimuli_builder.blinks.export.curve import AnimationCurve

CSV_COLUMNS = {
    "frame": "frame from 0",
    "time_s": "seconds from the first frame",
    "closure_left": "closure of the left eye, 0 open to 1 closed",
    "closure_right": "closure of the right eye",
    "lower_up_mm": "lift of the lower lids in mm",
    "lower_nasal_mm": "slide of the lower lids towards the nose in mm",
}


def to_csv(curve: AnimationCurve) -> str:
    """One row a frame, columns as in `CSV_COLUMNS`."""
    rows = [
        f"{frame},{frame / curve.fps:.6f},{left:g},{right:g},{up:g},{nasal:g}"
        for frame, (left, right, up, nasal) in enumerate(
            zip(curve.left, curve.right, curve.lower_up_mm, curve.lower_nasal_mm, strict=True)
        )
    ]
    return "\n".join([",".join(CSV_COLUMNS), *rows]) + "\n"


def to_json(curve: AnimationCurve) -> str:
    """The arrays of the CSV with the rate and each blink's name and onset frame."""
    content = {
        "format": "palpebra-blink-curve-1",
        "fps": curve.fps,
        "blinks": [{"profile_id": name, "onset_frame": onset} for name, onset in curve.blinks],
        "closure_left": curve.left.tolist(),
        "closure_right": curve.right.tolist(),
        "lower_up_mm": curve.lower_up_mm.tolist(),
        "lower_nasal_mm": curve.lower_nasal_mm.tolist(),
    }
    return json.dumps(content, indent=1) + "\n"
