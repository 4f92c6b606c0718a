"""What the server does for each kind of trial: a file of its name here, with `SERVED`.

Nothing else joins them: the name in the declaration finds the file.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Literal

from experiments.definition import Experiment
from server.trials.schemas import RatingIn
from server.trials.verdict import Ruling

if TYPE_CHECKING:
    from server.versions import LoadedVersion

Part = Literal["practice", "main", "attention"]


@dataclass(frozen=True)
class Served:
    """A kind of trial in the server.

    Attributes
    ----------
    validate: refuses (by an `Invalid`) an answer that the declaration does not allow in this part.
    judge: the verdict on the views of the clips with these ids by role (none for an attention check), by
        the declared playback rules.
    """

    validate: Callable[[Experiment, Part, RatingIn], None]
    judge: "Callable[[LoadedVersion, Mapping[str, int], RatingIn], Ruling]"


_SERVED: dict[str, Served] = {}


def served(kind: str) -> Served:
    """What the server does for trials of this kind."""
    if kind not in _SERVED:
        _SERVED[kind] = import_module(f"server.trials.kinds.{kind}").SERVED
    return _SERVED[kind]
