"""One exported row a trial: every column with its type, unit and sentence, declared here once.

The SQL view `ratings`, the CSV export, the codebook and the analysis all read this list. Names that jsPsych
uses for the same thing are kept (`trial_index`, `rt`, `response`, `stimulus`, `time_elapsed`).
The view carries a trial's levels as one JSON object in `levels`; the CSV has one column a factor instead.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

ColumnType = Literal["text", "integer", "number", "boolean", "time"]


@dataclass(frozen=True)
class Column:
    """A column of the view `ratings`; `sentence` is its line in the codebook."""

    name: str
    type: ColumnType
    sentence: str
    unit: str | None = None
    values: tuple[str, ...] = ()


RATING_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("experiment", "text", "Name of the declared experiment."),
    Column("definition_sha256", "text", "SHA-256 of the experiment's declaration this run was made with."),
    Column(
        "phase",
        "text",
        "Whether the run was made while the study was a pilot or live.",
        values=("pilot", "live"),
    ),
    Column("synthetic", "boolean", "True where no person gave this rating: simulated or synthesised data."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column(
        "participant",
        "text",
        "Identifier of the participant: the link's label, the recruiter's id, or the run's.",
    ),
    Column(
        "run_status",
        "text",
        "State of the visit.",
        values=("active", "complete", "screened_out", "withdrawn"),
    ),
    Column("language", "text", "Language the participant read."),
    Column(
        "trial_index", "integer", "Position of the trial in the run, from 0, practice and checks included."
    ),
    Column("kind", "text", "What the trial is.", values=("practice", "main", "attention")),
    Column("block", "integer", "Block number from 1; 0 for practice."),
    Column("block_label", "text", "Level of the factor that splits the blocks, or all."),
    Column("play", "integer", "Which play of this trial: 1, or more where a failed clip was shown again."),
    Column(
        "levels",
        "text",
        "JSON object of factor names and level names; the CSV has a column a factor instead.",
    ),
    Column("cell", "text", "Level names in factor order, joined by slashes."),
    Column("exemplar", "integer", "Which exemplar of the cell, from 1."),
    Column("profile_id", "text", "Identifier of the blink profile shown, as in the manifest."),
    Column("stimulus", "text", "File name of the clip."),
    Column("clip_sha256", "text", "SHA-256 of the clip's bytes."),
    Column("response", "integer", "The rating, on the declared scale."),
    Column("expected_response", "integer", "The answer asked for in an attention check."),
    Column("rt", "number", "Response time from the clip's last frame to the answer.", "ms"),
    Column("rt_from_first_frame", "number", "Response time from the clip's first frame to the answer.", "ms"),
    Column(
        "time_elapsed",
        "number",
        "Time from the start of the run to the answer, on the participant's clock.",
        "ms",
    ),
    Column("changes", "integer", "How often the answer was changed before it was confirmed."),
    Column("comment", "text", "What the participant wrote beside the rating, where asked."),
    Column("method", "text", "How the clip was played.", values=("webcodecs", "video", "none")),
    Column(
        "verdict", "text", "Playback verdict by the declared rules.", values=("good", "flagged", "failed")
    ),
    Column("verdict_rule", "text", "The rule that gave the verdict, empty where good."),
    Column("key_to_first_frame_ms", "number", "From the start key to the first frame drawn.", "ms"),
    Column("frames_drawn", "integer", "Frames of the clip that were drawn.", "frames"),
    Column("frames_late", "integer", "Frames drawn more than one refresh after their time.", "frames"),
    Column("frames_missing", "integer", "Frames of the clip that were never drawn.", "frames"),
    Column("longest_gap_ms", "number", "Longest time between two drawn frames.", "ms"),
    Column("stalls", "integer", "How often playback waited for data."),
    Column("focus_lost", "boolean", "True where the page lost focus or visibility during the clip."),
    Column("refresh_rate_hz", "number", "Measured refresh rate of the screen.", "Hz"),
    Column("device_pixel_ratio", "number", "Device pixels per CSS pixel."),
    Column("px_per_mm", "number", "CSS pixels per millimetre from the size calibration.", "px/mm"),
    Column("viewing_distance_mm", "number", "Viewing distance from the blind-spot test, where asked.", "mm"),
    Column("excluded", "boolean", "True where an experimenter excluded the run by hand."),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run."),
    Column("saved_at", "time", "When the server stored the row (UTC, ISO 8601)."),
)

COLUMN_NAMES: tuple[str, ...] = tuple(column.name for column in RATING_COLUMNS)


def csv_header(factors: Sequence[str]) -> list[str]:
    """Column names of the CSV export: as the view, with a column a factor in the place of `levels`."""
    header: list[str] = []
    for name in COLUMN_NAMES:
        header.extend(factors if name == "levels" else [name])
    return header


_LEVELS = COLUMN_NAMES.index("levels")


def csv_row(row: Sequence[Any], factors: tuple[str, ...]) -> tuple[Any, ...]:
    """One view row (values in the order of `COLUMN_NAMES`, booleans as 0 and 1) as CSV cells.

    What is missing stays None, which a CSV writer leaves empty.
    """
    return (*row[:_LEVELS], *_level_cells(row[_LEVELS], factors), *row[_LEVELS + 1 :])


# A study has few cells but many rows: their JSON is parsed once each.
@lru_cache(maxsize=4096)
def _level_cells(levels: str | None, factors: tuple[str, ...]) -> tuple[str, ...]:
    found: Mapping[str, str] = json.loads(levels) if levels else {}
    return tuple(found.get(factor, "") for factor in factors)


def factors_in_header(header: Iterable[str]) -> list[str]:
    """The factor columns of a CSV export: every column the contract does not name, in order."""
    return [name for name in header if name not in COLUMN_NAMES]
