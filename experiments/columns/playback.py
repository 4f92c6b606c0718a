"""Columns that describe how the clips of a trial were shown: playback, clock, views and screen.

Table aliases are those of the base columns, plus w for views.
"""

from experiments.columns import base
from experiments.columns.column import JOINED, Column

PLAYBACK: tuple[Column, ...] = (
    Column("method", "text", "Method of playback.", values=("webcodecs", "video", "none"), source="t"),
    Column(
        "verdict",
        "text",
        "Verdict on the presentation by the declared rules.",
        values=("good", "uncertain", "flagged", "failed"),
        source="t",
    ),
    Column("verdict_rule", "text", "The rule that determined the verdict; empty if good.", source="t"),
    Column(
        "key_to_first_frame_ms",
        "number",
        "Time from the start key to the first drawn frame.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column(
        "frames_drawn",
        "integer",
        "Number of frames of the clip that were drawn.",
        unit="frames",
        minimum=0,
        source="t",
    ),
    Column(
        "frames_late",
        "integer",
        "Number of frames drawn more than one refresh early or late.",
        unit="frames",
        minimum=0,
        source="t",
    ),
    Column(
        "frames_missing",
        "integer",
        "Number of frames of the clip that were never drawn.",
        unit="frames",
        minimum=0,
        source="t",
    ),
    Column(
        "longest_gap_ms",
        "number",
        "Longest time between two drawn frames.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column("stalls", "integer", "How often playback waited for data.", minimum=0, source="t"),
    Column(
        "focus_lost",
        "boolean",
        "True if the page lost focus or visibility during the clip.",
        source="t",
    ),
)

SCREEN: tuple[Column, ...] = (
    Column(
        "refresh_rate_hz",
        "number",
        "Measured refresh rate of the screen, or the rate seen during the presentation if that was higher.",
        unit="Hz",
        minimum=0,
        source="t",
    ),
    Column("device_pixel_ratio", "number", "Device pixels per CSS pixel.", minimum=0, source="t"),
    Column(
        "px_per_mm",
        "number",
        "CSS pixels per millimeter, from the size calibration.",
        unit="px/mm",
        minimum=0,
        source="t",
    ),
    Column(
        "viewing_distance_mm",
        "number",
        "Viewing distance from the blind-spot test, if the study has one.",
        unit="mm",
        minimum=0,
        source="t",
    ),
)

CLOCK: tuple[Column, ...] = (
    Column(
        "clock_gap_ms",
        "number",
        "Longest time between two callbacks of the animation clock that drew the clip.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column(
        "clock_late_ms",
        "number",
        "Longest delay of a callback of the animation clock after its refresh.",
        unit="ms",
        source="t",
    ),
)

_OF_TRIAL = "w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index"
_OUTCOMES = (
    "SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE 'begun' END) AS outcome "  # noqa: S608
    f"FROM views w WHERE {_OF_TRIAL} AND w.play = t.play ORDER BY w.number"
)

VIEWS: tuple[Column, ...] = (
    Column(
        "views",
        "integer",
        "Number of times the clips of this trial were started before this answer, including interrupted "
        "views; empty if the page kept no views.",
        minimum=1,
        source=f"nullif((SELECT count(*) FROM views w WHERE {_OF_TRIAL} "  # noqa: S608 - constants
        "AND w.play <= t.play), 0)",
    ),
    Column(
        "view_outcomes",
        "text",
        "How each view of this presentation ended, in order: shown, interrupted (a reload or a crash), or "
        "begun if its end is unknown.",
        source=f"(SELECT {JOINED}(o.outcome, ' ') FROM ({_OUTCOMES}) o)",  # noqa: S608 - constants
    ),
    Column(
        "disturbances",
        "text",
        "JSON object of disturbances in this presentation and their counts; empty if the page did not "
        "record them.",
        source="t",
        json=True,
    ),
)
"""Each view of the trial, with its start and its end."""

ASSUMED_REFRESH_HZ = 60
ONSET_DELAY_REFRESHES = {"Firefox/": 1, "Chrome/": 0}
"""Refreshes from drawing an image to the frame buffer, by user agent; `make scope` measures them."""

_REFRESH_MS = f"1000.0 / coalesce(t.refresh_rate_hz, {ASSUMED_REFRESH_HZ})"
# PostgreSQL rounds only `numeric`; the column is a plain number in both databases.
_ROUNDED = "CAST(round(CAST({} AS numeric), 2) AS double precision)"
_DELAYS = " ".join(
    f"WHEN CAST(r.device AS text) LIKE '%{browser}%' THEN {refreshes}"
    for browser, refreshes in ONSET_DELAY_REFRESHES.items()
)

PRESENTATION: tuple[Column, ...] = (
    Column(
        "onset_delay_ms",
        "number",
        "Delay from drawing an image to the frame buffer, as measured for this browser (none in Chromium, "
        "1 refresh in Firefox). Add it to recorded frame times, and subtract it from rt_from_first_frame. "
        "It excludes the delay of the monitor. Empty for other browsers, or if no frame was logged.",
        unit="ms",
        minimum=0,
        source="CASE WHEN t.method = 'webcodecs' THEN "
        f"{_ROUNDED.format(f'(CASE {_DELAYS} END) * {_REFRESH_MS}')} END",
    ),
    Column(
        "onset_uncertainty_ms",
        "number",
        "Maximum error of a frame time after adding onset_delay_ms, relative to the frame buffer: one "
        "refresh in good presentations. Empty for all others, which have no such guarantee.",
        unit="ms",
        minimum=0,
        source="CASE WHEN t.method = 'webcodecs' AND t.verdict = 'good' THEN "
        f"{_ROUNDED.format(_REFRESH_MS)} END",
    ),
)
"""What `make scope` measured about the path from drawing to the screen (docs/explanation/participant.md)."""


def answer_columns(shown: tuple[Column, ...], answer: tuple[Column, ...]) -> tuple[Column, ...]:
    """The columns of a view of answers in logical order, the same for every kind of trial.

    Parameters
    ----------
    shown, answer : tuple of Column
        What the kind's trial showed, and what was answered.
    """
    return (
        *base.STUDY,
        *base.RUN,
        *base.TRIAL,
        *shown,
        *answer,
        *base.CHECK,
        *base.TIMES,
        *PLAYBACK,
        *CLOCK,
        *PRESENTATION,
        *SCREEN,
        *VIEWS,
        *base.SAVED,
    )
