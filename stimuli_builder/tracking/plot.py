"""The trace of a track with its labelled blinks (the paper's Figure 3)."""

from pathlib import Path

from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.extract import blinks_of
from stimuli_builder.blinks.label_options import DEFAULT_OPTIONS
from stimuli_builder.blinks.plots import save_figure, series_figure
from stimuli_builder.blinks.series import read_series


def plot_track(track: Path, fps: float, figure: Path) -> int:
    """Recognise the blinks of a track, save the figure, return how many there are.

    With two eyes, the number of blinks is that of the eye that shows more.
    """
    given = read_series(track, (), fps)
    eyes = [
        blinks_of(series, DEFAULT_OPTIONS, recognised=recognised)
        for series, recognised in zip(given, recognise(given), strict=True)
    ]
    save_figure(series_figure(eyes, set()), figure)
    return max(len(eye.blinks) for eye in eyes)
