"""A column of the exports: its name, type, unit, meaning, range, and source in the database."""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

# A column of the exports: its name, type, unit, meaning, range, and source in the database.

JOINED = "{joined}"
"""Placeholder in a source for the function that joins texts; its name depends on the database."""
ColumnType = Literal["text", "integer", "number", "boolean", "time"]
"""A `number` read from JSON keeps its notation: 4 is exported as 4 and not as 4.0."""


@dataclass(frozen=True)
class Column:
    """A column of a view and its export; `description` is its line in the codebook.

    Attributes
    ----------
    unit : str or None
        The SI symbol, or the thing counted; None without a unit.
    values : tuple of str
        All possible values, for columns of names.
    labels : tuple of (str, str)
        Meanings of values, as pairs of value (as in the CSV) and label; not every value needs one.
    identifying : bool
        Whether it might identify a person: their own words, or data specific to their device.
    minimum, maximum : float or None
        The range of numbers, ends included; None where open.
    source : str
        The SQL behind it. An alias of the view's tables stands for `alias.name`; empty for columns without a
        view. `JOINED` in it is replaced by the function of the database.
    json : bool
        True where the source is a JSON column, exported as text.
    member : str
        Path of the value in the JSON object of the source (`choice`, `left.frames_drawn`); empty if the
        source is the value.
    otherwise : str
        SQL of the value used if there is none; empty for NULL.
    """

    name: str
    type: ColumnType
    description: str
    unit: str | None = None
    values: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    source: str = ""
    json: bool = False
    member: str = ""
    otherwise: str = ""
    labels: tuple[tuple[str, str], ...] = ()
    identifying: bool = False

    @property
    def expression(self) -> str:
        """The SQL behind the column, including the alias of its table."""
        return f"{self.source}.{self.name}" if self.source.isidentifier() else self.source

    @property
    def allowed(self) -> str:
        """The values or range of the column in words, with labels; empty if any value is allowed."""
        labels = dict(self.labels)
        if self.values:
            return ", ".join(f"{one} = {labels[one]}" if one in labels else one for one in self.values)
        range_, said = self._range, ", ".join(f"{value} = {label}" for value, label in self.labels)
        return f"{range_} ({said})" if range_ and said else range_ or said

    @property
    def _range(self) -> str:
        if self.minimum is not None and self.maximum is not None:
            return f"{self.minimum:g} to {self.maximum:g}"
        return f"{self.minimum:g} or more" if self.minimum is not None else ""

    def admits(self, value: object) -> bool:
        """True if `value` lies in the column's range or is one of its values; always true for None."""
        if value is None or (self.values and value == ""):
            return True
        if self.values:
            return value in self.values
        if not isinstance(value, int | float):
            return True
        low = self.minimum is None or value >= self.minimum
        return low and (self.maximum is None or value <= self.maximum)


def names_of(columns: Iterable[Column], *types: ColumnType) -> tuple[str, ...]:
    """Names of the columns of these types, in order; of all columns if no type is given."""
    return tuple(column.name for column in columns if not types or column.type in types)


# Names of columns made from names of levels, options and questions, which may be in any script.


def plain_name(text: str) -> str:
    """Letters, digits and underscores of `text`, without accents; `x` and code points if there are none.

    >>> plain_name("fast & near"), plain_name("Größe"), plain_name("-1.5"), plain_name("速")
    ('fast_near', 'Grosse', 'minus1_5', 'x901f')
    """
    signed = re.sub(r"^[-−](?=[\d.])", "minus", text.strip()).replace("ß", "ss")
    folded = unicodedata.normalize("NFKD", signed).encode("ascii", "ignore").decode()
    plain = re.sub(r"[^A-Za-z0-9]+", "_", folded).strip("_")
    return plain or "x" + "_".join(f"{ord(letter):x}" for letter in text[:8])


def unlike(name: str, taken: set[str]) -> str:
    """`name`, with a number appended if it is already taken (case-insensitive); it is then taken."""
    free, number = name, 2
    while free.casefold() in taken:
        free, number = f"{name}_{number}", number + 1
    taken.add(free.casefold())
    return free


# The order of columns until 0.2, which exports use on request (new columns were then added at the end).

_TRIAL = """
study experiment definition_sha256 phase synthetic run participant run_status language
trial_index kind block block_label play
"""
_CLIP = """
levels cell exemplar profile_id stimulus clip_sha256
"""
_ANSWERED = """
rt rt_from_first_frame time_elapsed changes comment method verdict verdict_rule
key_to_first_frame_ms frames_drawn frames_late frames_missing longest_gap_ms stalls focus_lost
refresh_rate_hz device_pixel_ratio px_per_mm viewing_distance_mm excluded exclusion_reason
saved_at run_origin study_version data_series clock_gap_ms clock_late_ms
"""
_OF_TABLE = {
    "ratings": f"""{_TRIAL}
{_CLIP} response expected_response {_ANSWERED} scale not_applicable scale_rt views
view_outcomes disturbances evidence_verdict check_response onset_delay_ms onset_uncertainty_ms
reference reference_gap_ms
""",
    "comparisons": f"""{_TRIAL}
left_cell left_exemplar left_stimulus left_clip_sha256 right_cell right_exemplar right_stimulus
right_clip_sha256 reference winner arrangement expected_response {_ANSWERED} views
view_outcomes disturbances evidence_verdict check_response onset_delay_ms onset_uncertainty_ms
""",
    "thresholds": f"""{_TRIAL}
series position value interval {_CLIP} response correct expected_response counts known ahead
threshold threshold_sd spread entropy {_ANSWERED} views view_outcomes disturbances
evidence_verdict check_response onset_delay_ms onset_uncertainty_ms
""",
    "traces": f"""{_TRIAL}
{_CLIP} response expected_response trace step_frames clip_fps moves blinks_s {_ANSWERED} views
view_outcomes disturbances check_response onset_delay_ms onset_uncertainty_ms evidence_verdict
""",
    "runs": """
study run participant phase synthetic status stage language version definition_sha256 seed slot
started_at consented_at completed_at trials excluded exclusion_reason erased forms device
run_origin data_series group_name evidence_verdict evidence_points evidence_tickets
evidence_digests evidence_clip_time evidence_claimed_time evidence_order evidence_late
evidence_interaction evidence_trusted evidence_press_ms evidence_press_spread
evidence_rt_median evidence_rt_spread evidence_same_answer evidence_cycle evidence_checks
evidence_motion_checks evidence_motion_checks_asked evidence_motion_checks_guessed
evidence_motion_checks_other_way evidence_motion_checks_void evidence_checks_guessed
calibration_method calibration_repeats calibration_spread calibration_ruler calibration_recheck
distance_method distance_spread_mm distance_typed_mm
""",
}
OLD_ORDER = {table: tuple(names.split()) for table, names in _OF_TABLE.items()}


def in_old_order(table: str, columns: Iterable[Column]) -> tuple[Column, ...]:
    """The columns of a table as they stood until 0.2; those of a younger table as they are."""
    position_before = {name: index for index, name in enumerate(OLD_ORDER.get(table, ()))}
    return tuple(sorted(columns, key=lambda column: position_before.get(column.name, len(position_before))))
