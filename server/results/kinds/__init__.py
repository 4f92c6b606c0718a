"""What the results page shows of each kind of trial: a file of its name here, with `summarise`.

Nothing else joins them: the name in the declaration finds the file. A kind without one says so in a line.
"""

from collections.abc import Callable
from importlib import import_module

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.results.schemas import AnyResults

Summarise = Callable[[Session, Study, StudyVersion, str], AnyResults]
"""The results of the answers of one origin, in the data series of a version."""


def summary_of(kind: str) -> Summarise:
    """How the answers to trials of this kind are summed up."""
    place = f"server.results.kinds.{kind}"
    try:
        summarise: Summarise = import_module(place).summarise
    except ModuleNotFoundError as error:
        if error.name != place:
            raise
        from server.results.kinds.unknown import summarise
    return summarise
