"""From rows to traces: clips that share a file are several trials; one panel per cell marks their blinks."""

from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from analysis.plans.continuous_rating import clips_of
from analysis.report.figures import traces_figure
from analysis.report.pictures import STYLE
from analysis.report.trace_contents import methods_of, sentences
from analysis.traces import ClipTraces, mean_trace
from experiments.errors import InputError


def prepared(*rows: tuple[str, str, str, str, str], rates: tuple[int, ...] = ()) -> Any:
    columns = ("participant", "cell", "clip_sha256", "trace", "blinks_s")
    table = pd.DataFrame(rows, columns=list(columns))
    table["step_frames"] = rates or 3
    return SimpleNamespace(rows=table.assign(clip_fps=30.0), source="traces.csv")


def test_every_trial_of_one_file_counts() -> None:
    """Open eyes are one file whatever the exemplar: three trials of it are three ratings of the cell."""
    (clip,) = clips_of(
        prepared(
            ("x", "none", "f00", "[10, 10]", ""),
            ("x", "none", "f00", "[20, 40]", ""),
            ("y", "none", "f00", "[50, 50, 50]", ""),
            ("y", "none", "f00", "", ""),
        )
    )
    assert clip.people == ("x", "x", "y")
    np.testing.assert_allclose(clip.values, [[10, 10], [20, 40], [50, 50]])
    mean = mean_trace([clip])
    assert mean.people == 2
    np.testing.assert_allclose(mean.mean, [32.5, 37.5])


def test_traces_of_several_rates_are_refused() -> None:
    row = ("x", "a", "f00", "[1, 2]", "[0.1]")
    with pytest.raises(InputError, match="with one sampling rate"):
        clips_of(prepared(row, row, rates=(3, 4)))


@pytest.mark.parametrize("cells", [1, 3])
def test_the_figure_has_a_panel_a_cell(cells: int) -> None:
    rng = np.random.default_rng(1)
    traces = [
        mean_trace([ClipTraces("a", str(k), 10.0, (0.3, 1.2), ("x", "y"), rng.normal(50, 5, (2, 20)))])
        for k in range(cells)
    ]
    assert traces[0].events_s == ((0.3, 1.2),)
    with mpl.rc_context(STYLE):
        picture = traces_figure(traces, [f"cell {k}" for k in range(cells)], 0.9, synthetic=True)
    assert picture.png.startswith(b"\x89PNG")
    assert f"in {cells} cells, with blinks marked" in picture.alt


def test_why_there_is_no_lag_is_said() -> None:
    values = np.array([[50.0, 51.0, 49.0]])
    blinking = mean_trace([ClipTraces("a", "x", 10.0, (0.1,), ("x",), values)])
    still = mean_trace([ClipTraces("b", "y", 10.0, (), ("x",), values)])
    assert sentences(None, [still]) == ("The lag cannot be estimated: the clips have no blinks.",)
    assert "fewer than two people" in sentences(None, [still, blinking])[0]
    assert "interval" not in methods_of([still], None)
    assert "lag" not in methods_of([still], None)
    with mpl.rc_context(STYLE):
        assert "blinks" not in traces_figure([still], ["y"], 0.0, synthetic=True).alt
