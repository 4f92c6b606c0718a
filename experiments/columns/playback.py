"""Columns of how a trial's clips were shown: the playback, its clock, the views, the screen.

Aliases of the tables as in the base columns, and w views.
"""

from experiments.columns import base
from experiments.columns.column import JOINED, Column

PLAYBACK: tuple[Column, ...] = (
    Column("method", "text", "How the clip was played.", values=("webcodecs", "video", "none"), source="t"),
    Column(
        "verdict",
        "text",
        "Playback verdict by the declared rules.",
        values=("good", "uncertain", "flagged", "failed"),
        source="t",
    ),
    Column("verdict_rule", "text", "The rule that gave the verdict, empty where good.", source="t"),
    Column(
        "key_to_first_frame_ms",
        "number",
        "From the start key to the first frame drawn.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column(
        "frames_drawn",
        "integer",
        "Frames of the clip that were drawn.",
        unit="frames",
        minimum=0,
        source="t",
    ),
    Column(
        "frames_late",
        "integer",
        "Frames drawn more than one refresh from their time.",
        unit="frames",
        minimum=0,
        source="t",
    ),
    Column(
        "frames_missing",
        "integer",
        "Frames of the clip that were never drawn.",
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
        "True where the page lost focus or visibility during the clip.",
        source="t",
    ),
)

SCREEN: tuple[Column, ...] = (
    Column(
        "refresh_rate_hz",
        "number",
        "Measured refresh rate of the screen; where the play itself saw a faster one, that one.",
        unit="Hz",
        minimum=0,
        source="t",
    ),
    Column("device_pixel_ratio", "number", "Device pixels per CSS pixel.", minimum=0, source="t"),
    Column(
        "px_per_mm",
        "number",
        "CSS pixels per millimetre from the size calibration.",
        unit="px/mm",
        minimum=0,
        source="t",
    ),
    Column(
        "viewing_distance_mm",
        "number",
        "Viewing distance from the blind-spot test, where asked.",
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
        "Longest time by which a callback of the animation clock ran after the refresh it was for.",
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
        "How often the trial's clips were begun to be shown up to this answer, views broken off included; "
        "empty where the page kept no views.",
        minimum=1,
        source=f"nullif((SELECT count(*) FROM views w WHERE {_OF_TRIAL} "  # noqa: S608 - constants
        "AND w.play <= t.play), 0)",
    ),
    Column(
        "view_outcomes",
        "text",
        "How each view of this play ended, in order: shown, interrupted (a reload or a crash), or begun "
        "where its end is not known.",
        source=f"(SELECT {JOINED}(o.outcome, ' ') FROM ({_OUTCOMES}) o)",  # noqa: S608 - constants
    ),
    Column(
        "disturbances",
        "text",
        "JSON object of what disturbed the views of this play and how often; empty where the page did not "
        "watch.",
        source="t",
        json=True,
    ),
)
"""Each view of the trial, as it was begun and as it ended."""

ASSUMED_REFRESH_HZ = 60
ONSET_DELAY_REFRESHES = {"Firefox/": 1, "Chrome/": 0}
"""Refreshes from drawing a picture to the frame buffer, by user agent; `make scope` measures them."""

_REFRESH_MS = f"1000.0 / coalesce(t.refresh_rate_hz, {ASSUMED_REFRESH_HZ})"
# PostgreSQL rounds `numeric` alone; the column is a plain number in both databases.
_ROUNDED = "CAST(round(CAST({} AS numeric), 2) AS double precision)"
_DELAYS = " ".join(
    f"WHEN CAST(r.device AS text) LIKE '%{browser}%' THEN {refreshes}"
    for browser, refreshes in ONSET_DELAY_REFRESHES.items()
)

PRESENTATION: tuple[Column, ...] = (
    Column(
        "onset_delay_ms",
        "number",
        "Add this to recorded times of pictures, and take it off rt_from_first_frame: the time from drawing "
        "a picture to the frame buffer as measured for the browser (none in Chromium, 1 refresh in Firefox), "
        "without the monitor's own delay. Empty for other browsers and where no frame was logged.",
        unit="ms",
        minimum=0,
        source="CASE WHEN t.method = 'webcodecs' THEN "
        f"{_ROUNDED.format(f'(CASE {_DELAYS} END) * {_REFRESH_MS}')} END",
    ),
    Column(
        "onset_uncertainty_ms",
        "number",
        "How far a picture's time, onset_delay_ms added, may be from the frame buffer's: one refresh in good "
        "plays. Empty for others, about which nothing is promised.",
        unit="ms",
        minimum=0,
        source="CASE WHEN t.method = 'webcodecs' AND t.verdict = 'good' THEN "
        f"{_ROUNDED.format(_REFRESH_MS)} END",
    ),
)
"""What `make scope` knows of the way from the drawing to the screen (docs/explanation/participant.md)."""


def answer_columns(shown: tuple[Column, ...], answer: tuple[Column, ...]) -> tuple[Column, ...]:
    """The columns of a view of answers in logical order, said here once for every kind of trial.

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
