"""What else `stimuli blinks` writes of a recording: the report, every frame in units, an animation curve."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.errors import InputError
from experiments.files import check_ending, whole_text
from stimuli_builder.blinks.csv_table import read_table
from stimuli_builder.blinks.export.formats import CurveTarget, check_format, write_curve
from stimuli_builder.blinks.extract import EyeBlinks, rate_doubts, without_blinks
from stimuli_builder.blinks.file_endings import TABLE, check_curve
from stimuli_builder.blinks.recorded_curve import recorded_curve
from stimuli_builder.blinks.series import BlinkSeries
from stimuli_builder.blinks.units import Scale, check_scale, scale_doubt, scale_of, write_lids


@dataclass(frozen=True)
class MoreOutputs:
    """Options of `stimuli blinks` for outputs beside the blinks table."""

    report: Path | None = None
    lids: Path | None = None
    scale: str | None = None
    curve: Path | None = None
    curve_format: str = "csv"

    @property
    def paths(self) -> tuple[Path | None, ...]:
        """Files to be written."""
        return self.report, self.lids, self.curve

    def check(self) -> None:
        """Refuse a format or a scale nobody knows before anything is read."""
        check_format(self.curve_format, CurveTarget(), "--curve-format")
        if self.scale is not None:
            check_scale(self.scale)
            if self.lids is None and self.report is None:
                sys.stderr.write(
                    "note: --scale has no effect here: mm stand in what --lids and --report write\n"
                )

    def check_names(self) -> None:
        """Refuse names that tell of another kind of file."""
        check_curve(self.curve, self.curve_format)
        check_ending(self.report, (".html", ".htm"), "--report")
        check_ending(self.lids, TABLE, "--lids")

    def prepared(
        self, source: Path, eyes: Sequence[EyeBlinks], frame: pd.DataFrame, closed: float | None
    ) -> list[Callable[[], None]]:
        """Work out what is asked for; what comes back writes it and cannot be refused any more.

        Parameters
        ----------
        closed : float or None
            Distance at lid contact that was given, for eyes without a blink too.

        Raises
        ------
        InputError
            The scale cannot be told, or a column without a blink has no closed level.
        """
        if not any(self.paths):
            return []
        table = read_table(source)
        scale = self._scale(table, eyes, source)
        doubts = [doubt for eye in eyes if (doubt := scale_doubt(eye.series, scale))]
        for doubt in doubts:
            sys.stderr.write(f"warning: {doubt}\n")
        writers: list[Callable[[], None]] = []
        if self.curve is not None:
            text = write_curve(self.curve_format, recorded_curve(eyes, closed), CurveTarget())
            writers.append(partial(_write_text, self.curve, text))
        if self.lids is not None:
            writers.append(partial(write_lids, self.lids, _with_closed(self.lids, eyes, closed), scale))
        if self.report is not None:
            from stimuli_builder.blinks.clinical_report import report_text

            page = report_text(source, eyes, frame, scale, [*_doubts(table, eyes), *doubts])
            writers.append(partial(_write_text, self.report, page))
        return writers

    def _scale(self, table: pd.DataFrame, eyes: Sequence[EyeBlinks], source: Path) -> Scale | None:
        scale, first = scale_of(table, self.scale, source), eyes[0].series
        if scale is not None and not first.is_px:
            raise InputError(
                f"--scale makes mm of px, and '{first.column}' is in another unit (names of columns in px "
                "end in _px): leave --scale out, or label a track"
            )
        return scale


def _with_closed(
    path: Path, eyes: Sequence[EyeBlinks], closed: float | None
) -> list[tuple[BlinkSeries, float]]:
    """Each series with its closed distance; an eye of which nothing tells it is left out, and said."""
    known = [(eye.series, eye.closed_distance(closed)) for eye in eyes]
    for series, level in known:
        if level is None:
            sys.stderr.write(
                f"note: {path}: without {series.column}, which has no blink (--closed tells it)\n"
            )
    levels = [(series, level) for series, level in known if level is not None]
    if not levels:
        raise InputError(f"{path}: there is no blink, and nothing tells where lids are closed: give --closed")
    return levels


def _write_text(path: Path, text: str) -> None:
    with whole_text(path) as stream:
        stream.write(text)


def _doubts(table: pd.DataFrame, eyes: Sequence[EyeBlinks]) -> list[str]:
    """What a track says of its own frames, and rates that are unlikely."""
    lines = [*without_blinks(eyes), *rate_doubts(eyes), *eyes[0].series.notes]
    lost = int((table["status"] == "lost").sum()) if "status" in table.columns else 0
    if lost:
        lines.append(f"{lost:,} of {len(table):,} frames are lost")
    if "error_px" in table.columns and table["error_px"].notna().any():
        lines.append(f"stated error of the points, median: {table['error_px'].median():.2f} px")
    return lines
