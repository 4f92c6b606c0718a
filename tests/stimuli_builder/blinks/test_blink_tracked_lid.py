import numpy as np
import pandas as pd
import pytest

from stimuli_builder.blinks.export import lower_lid
from stimuli_builder.blinks.extract import blinks_of, eye_profiles
from stimuli_builder.blinks.labelling import DEFAULT_OPTIONS
from stimuli_builder.blinks.series import FISSURE_LENGTH_MM, read_series, tracked_lower_lid

WIDTH_PX = 141.0
OUTLINE = [(0, 0), (20, -20), (55, -30), (85, -30), (120, -20), (141, 0), (115, 12), (70, 15), (25, 12)]


def track(known, angle=0.0, mirrored=False):
    """One eye whose lower lid slides 10 px to the nose and lifts 4 px as the eye shuts; the head drifts."""
    closure = 1 - known.distance / known.distance.max()
    points = np.tile(np.array(OUTLINE, float), (closure.size, 1, 1))
    points[:, 6:] += closure[:, None, None] * np.array([10.0, -4.0])
    if mirrored:
        points[..., 0] *= -1
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    drift = np.linspace(0, 3, closure.size)[:, None]
    points = points @ turn + 300 + drift[:, None]
    columns = {f"{axis}{k + 1:02d}": points[:, k, i] for k in range(9) for i, axis in enumerate("xy")}
    times = np.arange(closure.size) / known.fps
    return pd.DataFrame({"time_s": times, **columns, "distance_px": known.distance, "status": "ok"})


@pytest.mark.parametrize(("angle", "mirrored"), [(0.0, False), (0.2, False), (-0.1, True)])
def test_the_lower_lid_is_measured_along_the_axis_of_the_eye(make_known, tmp_path, angle, mirrored):
    known = make_known(depths=(1.0, 1.0, 0.5))
    track(known, angle, mirrored).to_csv(tmp_path / "track.csv", index=False)
    (series,) = read_series(tmp_path / "track.csv")
    first, _, partial = eye_profiles(blinks_of(series, DEFAULT_OPTIONS), "track", None)
    up, nasal = lower_lid(first)
    px = FISSURE_LENGTH_MM / WIDTH_PX
    assert nasal.max() == pytest.approx(10 * px, rel=0.05)
    assert up.max() == pytest.approx(4 * px, rel=0.05)
    assert lower_lid(partial)[1].max() == pytest.approx(5 * px, rel=0.05)
    assert up[0] == nasal[0] == 0


def test_frames_without_a_fit_leave_the_rest(make_known):
    table = track(make_known(depths=(1.0,)))
    table.loc[5:20, "x01":"y09"] = np.nan
    measured = tracked_lower_lid(table, "distance_px")
    assert measured is not None
    assert np.isnan(measured[0][5:21]).all()
    assert np.isfinite(measured[0][21:]).all()


def test_a_table_without_landmarks_has_no_lower_lid(make_known):
    assert tracked_lower_lid(track(make_known())[["time_s", "distance_px"]], "distance_px") is None
