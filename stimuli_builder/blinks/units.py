"""Lids in units: mm, degrees of lid rotation, and closure from 0 to 1 for a person, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, nearest
from experiments.files import whole_file
from stimuli_builder.blinks.csv_table import read_table, write_table
from stimuli_builder.blinks.events.candidates import local_opening
from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array
from stimuli_builder.blinks.series import FISSURE_LENGTH_MM, BlinkSeries

INTER_OCULAR_MM = 60.0
"""Between the middles of both eyes' openings; people differ by some 6% (sd)."""
LID_RADIUS_MM = 12.0
"""Radius about which the upper lid's margin turns: the eyeball's."""
SCALES = {
    "inter-ocular": f"the centers of both eyes are {INTER_OCULAR_MM:g} mm apart",
    "eye-width": f"an eye is {FISSURE_LENGTH_MM:g} mm wide from canthus to canthus",
}


IRIS_FILE = "iris:"
"""Beginning of a scale by the irises of a table that `stimuli iris` wrote."""
LEAST_IRISES = 5
MAX_IRIS_RATIO = 1.25
"""Greatest ratio of both eyes' irises: a head turned by 35 degrees, at the distance of an arm."""
FISSURES_MM = (3.0, 16.0)
"""Openings of people's eyes; what lies outside has another scale than the one that was given."""


@dataclass(frozen=True)
class Scale:
    """Millimeters per pixel, and the assumption it rests on."""

    mm_per_px: float
    rule: str


def scale_doubt(series: BlinkSeries, scale: Scale | None) -> str:
    """A line where the usual opening in mm is none of a person's; empty otherwise."""
    if scale is None:
        return ""
    # The open eye in spite of blinks, see `OPEN_PERCENTILE`.
    opening = float(np.nanpercentile(series.distance, OPEN_PERCENTILE)) * scale.mm_per_px
    if FISSURES_MM[0] <= opening <= FISSURES_MM[1]:
        return ""
    return (
        f"{series.column}: the lids are {opening:.3g} mm apart when open, but usual values are "
        f"{FISSURES_MM[0]:g} to {FISSURES_MM[1]:g}: check --scale ({scale.rule})"
    )


def check_scale(scale: str) -> float | None:
    """Return the mm per pixel of a requested scale, or None where it is a rule of `SCALES`.

    Raises
    ------
    InputError
        The requested scale is neither a possible number nor a rule.
    """
    if scale in SCALES:
        return None
    irises = iris_table(scale)
    if irises is not None:
        # Only for its errors, before a long recording is read.
        _by_irises(irises)
        return None
    try:
        value = float(scale)
    except ValueError:
        rules = ", ".join(f"'{rule}'" for rule in SCALES) + f" or '{IRIS_FILE}' and a table of stimuli iris"
        near = nearest(scale, SCALES)
        raise InputError(
            f"--scale {scale}: expected a number of mm per pixel, {rules}"
            + (f"; did you mean '{near}'?" if near else "")
        ) from None
    # 10 mm per pixel would put a whole eye into three pixels.
    if not (np.isfinite(value) and 0 < value < 10):
        raise InputError(f"--scale must be a number of mm per pixel above 0 and below 10, got {scale}")
    return value


def scale_of(table: pd.DataFrame, scale: str | None, path: Path) -> Scale | None:
    """Return the scale of a track: a number of mm per pixel, or a rule of `SCALES`; None if none is
    requested.

    Raises
    ------
    InputError
        The requested scale is neither a number nor a rule, or the table has no landmarks for the rule.
    """
    if scale is None:
        return None
    irises = iris_table(scale)
    if irises is not None:
        return _by_irises(irises)
    value = check_scale(scale)
    if value is None:
        return _by_rule(table, scale, path)
    return Scale(value, f"{value:g} mm per pixel, as given (from a card or a ruler in the picture)")


def iris_table(scale: str | None) -> Path | None:
    """The table of irises that a wish for a scale names; None where it names none."""
    return Path(scale.removeprefix(IRIS_FILE)) if scale is not None and scale.startswith(IRIS_FILE) else None


def _by_irises(path: Path) -> Scale:
    """The scale by the median diameter of the irises in a table of `stimuli iris`, both eyes together."""
    from stimuli_builder.tracking.iris import IRIS_MM

    table = read_table(path)
    columns = [name for name in table.columns if name.endswith("iris_diameter_px")]
    diameters = table[columns].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    # A frame without an iris has 0 or nothing.
    seen = diameters[np.isfinite(diameters) & (diameters > 0)]
    if seen.size < LEAST_IRISES:
        raise InputError(
            f"--scale {IRIS_FILE}{path.name}: expected a table of stimuli iris with {LEAST_IRISES} irises or "
            f"more, got {seen.size}; measure them with stimuli iris VIDEO TRACK --out I.csv"
        )
    # A column without any value is of an eye that was never seen.
    middles = [float(np.nanmedian(one)) for one in diameters.T if np.isfinite(one).any()]
    if max(middles) > MAX_IRIS_RATIO * min(middles):
        raise InputError(
            f"--scale {IRIS_FILE}{path.name}: the irises of both eyes are {min(middles):.3g} and "
            f"{max(middles):.3g} px wide (medians), which is implausible for one face. Check the recording "
            "with stimuli track --preview, or give mm per pixel"
        )
    # Irises vary least between people; the median ignores frames with half-covered ones.
    middle = float(np.median(seen))
    rule = f"an iris is {IRIS_MM:g} mm wide, {middle:.1f} px here (median of {seen.size:,} in {path.name})"
    return Scale(IRIS_MM / middle, rule)


def _by_rule(table: pd.DataFrame, rule: str, path: Path) -> Scale:
    count = 18 if rule == "inter-ocular" else 9
    names = [f"{axis}{point:02d}" for point in range(1, count + 1) for axis in "xy"]
    if not set(names) <= set(table.columns):
        raise InputError(
            f"{path.name}: --scale {rule} needs a track of {'both eyes' if count == 18 else 'an eye'}"
        )
    points = table[names].to_numpy(dtype=np.float64).reshape(len(table), -1, 9, 2)
    if rule == "inter-ocular":
        # The middle of the canthi and not of all points, which a blink would move.
        middles = (points[:, :, 0] + points[:, :, 5]) / 2
        length, true = np.hypot(*(middles[:, 1] - middles[:, 0]).T), INTER_OCULAR_MM
    else:
        length, true = np.hypot(*(points[:, 0, 5] - points[:, 0, 0]).T), FISSURE_LENGTH_MM
    if not np.isfinite(length).any():
        raise InputError(f"{path.name}: no frame has landmarks, so the scale cannot be computed")
    # The median: heads turn, and single frames are wrong.
    return Scale(true / float(np.nanmedian(length)), SCALES[rule])


def closure_course(series: BlinkSeries, closed_distance: float) -> Array:
    """Closure (n,) of a person's eye: 0 at its opening about then, 1 at lid contact; NaN in gaps.

    c = (o - d) / (o - d0), o the local opening (drift of the head removed), d0 the closed distance.
    """
    known = np.isfinite(series.distance)
    opening = np.full(known.size, np.nan)
    opening[known] = local_opening(series.distance[known], series.fps)
    # An opening that falls to the closed distance would divide by zero.
    span = np.maximum(opening - closed_distance, 1e-9)
    return np.clip((opening - series.distance) / span, 0.0, 1.0)


def lid_degrees(distance_mm: Array) -> Array:
    """Rotation of the upper lid in degrees that opens the eye by a distance: 2 asin(d / (2 R)), R = 12 mm."""
    # A distance above the diameter of the ball has no angle.
    half = np.arcsin(np.clip(distance_mm / (2 * LID_RADIUS_MM), 0, 1))
    return np.asarray(np.degrees(2 * half))


def write_lids(path: Path, eyes: Sequence[tuple[BlinkSeries, float]], scale: Scale | None) -> None:
    """Write every frame's distance, closure and, with a scale, mm and degrees, a column per eye.

    `eyes` holds each series with its closed distance.
    """
    first = eyes[0][0]
    columns: dict[str, NDArray[Any]] = {
        "frame": np.arange(first.distance.size),
        "time_s": np.round(np.arange(first.distance.size) / first.fps, 6),
    }
    for series, closed in eyes:
        # The unit in the name would be wrong for closure, mm and degrees.
        name = series.column.removesuffix("_px")
        columns[series.column] = np.round(series.distance, 4)
        columns[f"{name}_closure"] = np.round(closure_course(series, closed), 5)
        if scale is not None:
            mm = series.distance * scale.mm_per_px
            columns[f"{name}_mm"] = np.round(mm, 4)
            columns[f"{name}_degrees"] = np.round(lid_degrees(mm), 3)
    with whole_file(path) as partial:
        write_table(partial, pd.DataFrame(columns))
