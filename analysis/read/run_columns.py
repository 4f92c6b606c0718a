"""Columns of a study's ratings that hold one value for a whole run."""

from experiments.columns import names_of
from experiments.trials.clip_rating.columns import RATINGS

_OF_A_RUN = RATINGS.pick(
    "study",
    "experiment",
    "definition_sha256",
    "phase",
    "participant",
    "run_status",
    "exclusion_reason",
    "synthetic",
    "excluded",
    "run_origin",
    "study_version",
    "data_series",
)
RUN_TEXTS = names_of(_OF_A_RUN, "text", "integer")
RUN_FLAGS = names_of(_OF_A_RUN, "boolean")
"""Columns that are the same for all rows of a run."""
