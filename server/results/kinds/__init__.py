"""What the results page shows of each kind of trial: a file of its name here, with `summarise`.

Nothing else joins them: the name in the declaration finds the file. A kind without one says so in a line.
"""

from collections.abc import Callable
from importlib import import_module

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.results.repository import Pool
from server.results.schemas import AnyResults

Summarise = Callable[[Session, Study, StudyVersion, Pool], AnyResults]
"""The results of a pool of answers, which is of the data series of this version."""


def summary_of(kind: str) -> Summarise:
    """How the answers to trials of this kind are summed up."""
    module = f"server.results.kinds.{kind}"
    try:
        summarise: Summarise = import_module(module).summarise
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        from server.results.kinds.unknown import summarise
    return summarise
