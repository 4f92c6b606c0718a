"""What of a study's data an export holds: one origin, or all of them; one data series, or every one."""

from dataclasses import dataclass
from typing import Literal, get_args

from sqlalchemy import ColumnElement

from server.models import Study, StudyRun
from server.studies.repository import ids_of_series

ExportOrigin = Literal["participant", "pilot", "simulated", "all"]
"""Previews are in no export: they are stored for a day only."""
EXPORTED = get_args(ExportOrigin)[:-1]


@dataclass(frozen=True)
class Extract:
    """The part of a study's data that goes out; without a series of each, told apart by a column.

    Attributes
    ----------
    origin : ExportOrigin
    series : int or None
    old_order : bool
        Whether columns stand as they stood until 0.2.
    """

    origin: ExportOrigin = "participant"
    series: int | None = None
    old_order: bool = False

    def condition(self, study: Study) -> ColumnElement[bool]:
        """The condition that a run of the study is in it."""
        origins = EXPORTED if self.origin == "all" else (self.origin,)
        runs = (StudyRun.study_id == study.id) & StudyRun.origin.in_(origins)
        if self.series is None:
            return runs
        return runs & StudyRun.version_id.in_(ids_of_series(study, self.series))

    def __str__(self) -> str:
        """In words, as READMEs have it."""
        one, every = f"the origin `{self.origin}` alone", "all origins, distinguished by `run_origin`"
        series = "" if self.series is None else f", data series {self.series} alone"
        return (every if self.origin == "all" else one) + series

    @property
    def file_part(self) -> str:
        """What file names say of it: nothing for participants of every series."""
        origin = "" if self.origin == "participant" else f"-{self.origin}"
        return origin + ("" if self.series is None else f"-series-{self.series}")


EVERYTHING = Extract("all")
