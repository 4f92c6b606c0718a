"""Figures after the paper's: the labeled series (3), aligned blinks (6), the model (7), made curves (8)."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.errors import InputError, counted, did_you_mean
from experiments.files import whole_file
from stimuli_builder.blinks.blink_model import BlinkModel
from stimuli_builder.blinks.extract import EyeBlinks
from stimuli_builder.blinks.profile import BlinkProfile, phase_spline
from stimuli_builder.blinks.tables import AMPLITUDE_BINS, DURATION_BIN_MS, aligned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, RED, GREY, AMBER, GREEN = "#2b6cb0", "#c53030", "#8a94a3", "#b7791f", "#2f855a"
FORMATS = ("png", "svg", "pdf")
SECONDS_A_ROW = 10.0
MAX_ROWS = 12


def _figure(width: float, height: float) -> "Figure":
    # Imported here: commands without figures start faster.
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _tidy(axes: "Axes", x_label: str, y_label: str) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG, SVG or PDF by the name's ending; nothing of it depends on the clock."""
    check_figure_name(path)
    # PNG has no date by itself.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(path.suffix[1:].lower())
    with whole_file(path) as partial:
        figure.savefig(partial, dpi=150, metadata=metadata)


def check_figure_name(path: Path) -> None:
    """Reject a name whose ending is not a figure format."""
    ending = path.suffix.lstrip(".").lower()
    if ending not in FORMATS:
        raise InputError(f"{path.name}: '{ending}' is not a figure format{did_you_mean(ending, FORMATS)}")


def series_figure(eyes: Sequence[EyeBlinks], rejected: set[tuple[str, int]]) -> "Figure":
    """Figure 3: the distance over time, every labeled blink marked from onset to end.

    Ten seconds per row for the first two minutes; a longer recording is drawn in twelve longer rows.
    """
    duration_s = max(eye.smooth.size / eye.series.fps for eye in eyes)
    row_s = max(SECONDS_A_ROW, duration_s / MAX_ROWS)
    # A rest of less than a twentieth of a row goes into the last one.
    rows = max(1, int(np.ceil(duration_s / row_s - 0.05)))
    top = max((float(np.nanmax(eye.smooth)) for eye in eyes if np.isfinite(eye.smooth).any()), default=0.0)
    top = top or 1.0  # columns of zeros have no height
    figure = _figure(12, 0.8 + 1.5 * rows)
    grid = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for row, axes in enumerate(grid):
        # The last row ends with the recording, so that nothing is cut off.
        stop_s = duration_s if row == rows - 1 else (row + 1) * row_s
        for position, eye in enumerate(eyes):
            _series_row(axes, eye, row * row_s, stop_s, position, rejected, top)
        axes.set_ylim(-0.03 * top, 1.12 * top)
        # Rows have one scale; a recording of one row ends where it ends.
        axes.set_xlim(row * row_s, stop_s if rows == 1 else max(stop_s, (row + 1) * row_s))
        axes.spines[["top", "right"]].set_visible(False)
    unit = "px" if eyes[0].series.is_px else "as recorded"
    grid[-1].set_xlabel("time (s)")
    figure.supylabel(f"inter-eyelid distance ({unit})", fontsize=10)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), frameon=False, fontsize=9)
    return figure


def _series_row(
    axes: "Axes",
    eye: EyeBlinks,
    start_s: float,
    stop_s: float,
    position: int,
    rejected: set[tuple[str, int]],
    top: float,
) -> None:
    """One row of one eye; `top` is the greatest distance of all eyes, so that each is seen whole."""
    # More than four columns share colors; their legends differ.
    colour = (BLUE, AMBER, GREEN, GREY)[position % 4]
    fps = eye.series.fps
    first, last = int(start_s * fps), min(int(np.ceil(stop_s * fps)) + 1, eye.smooth.size)
    # More points than a row has pixels slow the drawing down and change nothing.
    step = max(1, (last - first) // 6000)
    frames = np.arange(first, last, step)
    axes.plot(frames / fps, eye.smooth[first:last:step], color=colour, lw=0.9, label=eye.series.column)
    for blink in eye.blinks:
        # A blink on the border of two rows is drawn in both.
        if blink.end_s <= start_s or blink.onset_s >= stop_s:
            continue
        out = (eye.series.column, blink.number) in rejected
        axes.axvspan(blink.onset_s, blink.end_s, color=GREY if out else colour, alpha=0.13, lw=0)
        for frame, marker in ((blink.onset_frame, ">"), (blink.minimum_frame, "v"), (blink.end_frame, "<")):
            axes.plot(frame / fps, eye.smooth[frame], marker, ms=3.5, color=GREY if out else RED)
        # Rejected blinks keep their number, since reviews refer to it.
        label = f"({blink.number})" if out else f"{blink.number}"
        axes.annotate(
            label,
            (blink.end_s, (0.7 - 0.2 * position) * top),
            xytext=(3, 0),
            textcoords="offset points",
            fontsize=7,
            color=colour,
        )


def sequence_figure(blinks: pd.DataFrame) -> "Figure":
    """Main sequence: peak closing and opening speed over amplitude, and closure over duration."""
    figure = _figure(12, 4)
    left, right = figure.subplots(1, 2)
    for position, (column, part) in enumerate(blinks.groupby("column", sort=False)):
        colour = (BLUE, AMBER, GREEN, GREY)[position % 4]
        left.scatter(part["amplitude"], part["peak_closing_velocity"], 18, colour, label=f"{column}, closing")
        left.scatter(
            part["amplitude"], part["peak_opening_velocity"], 18, "none", edgecolors=colour,
            label=f"{column}, opening",
        )  # fmt: skip
        right.scatter(part["duration_ms"], part["closure"], 18, colour, label=str(column))
    _tidy(left, "amplitude", "peak speed (per second)")
    _tidy(right, "duration (ms)", "greatest closure")
    if len(blinks):
        left.legend(frameon=False, fontsize=9)
    return figure


def aligned_figure(groups: dict[str, Sequence[BlinkProfile]]) -> "Figure":
    """Figure 6: blinks laid on their minima with their mean, durations, amplitudes; one row per group."""
    figure = _figure(12, 0.4 + 3.2 * len(groups))
    grid = figure.subplots(len(groups), 3, squeeze=False, width_ratios=[2, 1, 1])
    for (title, profiles), (blinks, durations, amplitudes) in zip(groups.items(), grid, strict=True):
        time_ms, closures = aligned(profiles)
        for closure in closures:
            blinks.plot(time_ms, 1 - closure, color=BLUE, lw=0.7, alpha=0.45)
        blinks.plot(time_ms, 1 - closures.mean(axis=0), color=RED, lw=2.2, label="mean")
        blinks.set_title(f"{title}: {counted(len(profiles), 'blink')}", loc="left", fontsize=10)
        blinks.legend(frameon=False, loc="lower right")
        _tidy(blinks, "time from the minimum (ms)", "opening (1 = open)")
        lengths = np.array([profile.duration_frames_30fps for profile in profiles])
        # Bins of one frame, as in the figure of the paper.
        durations.hist(lengths, bins=np.arange(0, int(lengths.max()) + 2), color=BLUE, rwidth=0.9)
        _tidy(durations, f"duration (frames of {DURATION_BIN_MS:.1f} ms)", "blinks")
        amplitudes.hist(
            [p.closure.max() for p in profiles], np.linspace(0, 1, AMPLITUDE_BINS + 1), color=BLUE, rwidth=0.9
        )
        _tidy(amplitudes, "greatest closure", "blinks")
        for histogram in (durations, amplitudes):
            # Counts: half a blink on the axis would look odd.
            histogram.yaxis.get_major_locator().set_params(integer=True)
    return figure


def model_figure(
    model: BlinkModel, training: Sequence[BlinkProfile], made: Sequence[BlinkProfile]
) -> "Figure":
    """Figure 7: training blinks, the same normalized to the mean phase lengths, components, new blinks."""
    figure = _figure(12, 6.6)
    (recorded, normalised), (components, new) = figure.subplots(2, 2)
    _curves(recorded, training, "(a) recorded blinks")
    _normalised_curves(normalised, model, training)
    _component_curves(components, model)
    _curves(new, made, "(d) blinks generated by the model")
    return figure


def _curves(axes: "Axes", profiles: Sequence[BlinkProfile], title: str) -> None:
    for profile in profiles:
        time_ms = (np.arange(profile.closure.size) - profile.onset_index) * 1000 / profile.fps
        axes.plot(time_ms, 1 - profile.closure, color=BLUE, lw=0.9, alpha=0.6)
        if profile.closure_other is not None:
            axes.plot(time_ms, 1 - profile.closure_other, color=AMBER, lw=0.9, alpha=0.6)
    axes.set_title(title, loc="left", fontsize=10)
    axes.set_ylim(-0.05, 1.08)
    _tidy(axes, "time from the onset (ms)", "opening (1 = open)")


def _normalised_curves(axes: "Axes", model: BlinkModel, training: Sequence[BlinkProfile]) -> None:
    for profile in training:
        middle = profile.minimum_index
        down = phase_spline(profile.closure[profile.onset_index : middle + 1], model.down_frames)
        up = phase_spline(profile.closure[middle : profile.end_index + 1], model.up_frames)
        # Both phases hold the minimum; it is drawn once.
        axes.plot(1 - np.concatenate([down, up[1:]]), color=BLUE, lw=0.9, alpha=0.6)
    mean, _, _ = model.normalised_forms(np.zeros(model.coefficient_sd.size))
    axes.plot(1 - mean[0], color=RED, lw=2, label="mean of the model")
    axes.axvline(model.down_frames, color=GREY, lw=0.8, ls=":")
    axes.set_title(f"(b) normalized: {model.down_frames} + {model.up_frames} frames", loc="left", fontsize=10)
    axes.set_ylim(-0.05, 1.08)
    axes.legend(frameon=False, loc="lower right")
    _tidy(axes, "frame at 300 fps", "opening (1 = open)")


def _component_curves(axes: "Axes", model: BlinkModel) -> None:
    colours = (BLUE, RED, GREEN, AMBER, GREY)
    for index, share in enumerate(model.explained):
        one = np.zeros(model.coefficient_sd.size)
        mean, _, _ = model.normalised_forms(one)
        # One standard deviation of each coefficient, the others at their mean.
        one[index] = model.coefficient_sd[index]
        form, down_scale, up_scale = model.normalised_forms(one)
        _, down_mean, up_mean = model.normalised_forms(np.zeros_like(one))
        # A component changes the lengths of the phases, too; a curve on a common length hides it.
        timing = f"down {down_scale - down_mean:+.2f}, up {up_scale - up_mean:+.2f}"
        label = f"{index + 1}: {share:.1%} ({timing})"
        axes.plot(mean[0] - form[0], color=colours[index % len(colours)], lw=1.4, label=label)
    axes.axvline(model.down_frames, color=GREY, lw=0.8, ls=":")
    title = f"(c) components, one standard deviation each: {model.variance_kept:.1%} of the variance"
    axes.set_title(title, loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=7, title="share (change of scale)", title_fontsize=7)
    _tidy(axes, "frame at 300 fps", "change of opening")


def profiles_figure(profiles: Sequence[BlinkProfile], title: str) -> "Figure":
    """Figure 8: a few made profiles over one another, named."""
    figure = _figure(7, 4)
    axes = figure.subplots()
    # Colors repeat where there are more than six profiles.
    for profile, colour in zip(
        profiles, (BLUE, GREEN, RED, "#6b46c1", "black", AMBER) * len(profiles), strict=False
    ):
        axes.plot(1 - profile.closure, color=colour, lw=1.5, label=profile.source.removeprefix("textbook: "))
    axes.set_title(title, loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=8)
    _tidy(axes, "frame at 300 fps", "opening (1 = open)")
    return figure
