"""What else `stimuli blinks` writes of a recording: the report, every frame in units, an animation curve."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.blinks.csv_table import read_table
from stimuli_builder.blinks.export.formats import CurveTarget, check_format, write_curve
from stimuli_builder.blinks.extract import EyeBlinks, rate_doubts
from stimuli_builder.blinks.recorded_curve import recorded_curve
from stimuli_builder.blinks.units import check_scale, scale_doubt, scale_of, write_lids


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
        check_format(self.curve_format, CurveTarget())
        if self.scale is not None:
            check_scale(self.scale)
            if self.lids is None and self.report is None:
                sys.stderr.write(
                    "note: --scale has no effect here: mm stand in what --lids and --report write\n"
                )

    def prepared(
        self, source: Path, eyes: Sequence[EyeBlinks], frame: pd.DataFrame
    ) -> list[Callable[[], None]]:
        """Work out what is asked for; what comes back writes it and cannot be refused any more.

        Raises
        ------
        InputError
            The scale cannot be told, or a column without a blink has no closed level.
        """
        if not any(self.paths):
            return []
        table = read_table(source)
        scale = scale_of(table, self.scale, source)
        if scale is not None and not eyes[0].series.is_px:
            raise InputError(f"--scale needs distances in px; '{eyes[0].series.column}' is in another unit")
        doubts = [doubt for eye in eyes if (doubt := scale_doubt(eye.series, scale))]
        for doubt in doubts:
            sys.stderr.write(f"warning: {doubt}\n")
        writers: list[Callable[[], None]] = []
        if self.curve is not None:
            text = write_curve(self.curve_format, recorded_curve(eyes), CurveTarget())
            writers.append(partial(_write_text, self.curve, text))
        if self.lids is not None:
            known = [(eye.series, eye.blinks[0].closed_distance) for eye in eyes if eye.blinks]
            for eye in eyes:
                if not eye.blinks:
                    sys.stderr.write(f"note: {self.lids}: without {eye.series.column}, which has no blink\n")
            writers.append(partial(write_lids, self.lids, known, scale))
        if self.report is not None:
            from stimuli_builder.blinks.clinical_report import report_text

            page = report_text(source, eyes, frame, scale, [*_doubts(table, eyes), *doubts])
            writers.append(partial(_write_text, self.report, page))
        return writers


def _write_text(path: Path, text: str) -> None:
    with whole_text(path) as stream:
        stream.write(text)


def _doubts(table: pd.DataFrame, eyes: Sequence[EyeBlinks]) -> list[str]:
    """What a track says of its own frames, and rates that are unlikely."""
    lines = [*rate_doubts(eyes), *eyes[0].series.notes]
    lost = int((table["status"] == "lost").sum()) if "status" in table.columns else 0
    if lost:
        lines.append(f"{lost:,} of {len(table):,} frames are lost")
    if "error_px" in table.columns and table["error_px"].notna().any():
        lines.append(f"stated error of the points, median: {table['error_px'].median():.2f} px")
    return lines
