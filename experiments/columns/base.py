"""Columns that every kind of trial exports: the study, the run, the trial, its clip, its times, its playback.

Names that jsPsych uses for the same thing are kept (`trial_index`, `rt`, `response`, `stimulus`,
`time_elapsed`). Aliases of the tables: s studies, v study_versions, r study_runs, a assigned_trials,
t trial_ratings, c version_clips.
"""

from experiments.columns.column import JOINED, Column

STUDY: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server.", source="s.name"),
    Column("experiment", "text", "Name of the declared experiment.", source="v"),
    Column(
        "definition_sha256",
        "text",
        "SHA-256 of the experiment's declaration this run was made with.",
        source="v",
    ),
)

RUN: tuple[Column, ...] = (
    Column(
        "phase",
        "text",
        "Whether the run was made while the study was a pilot or live.",
        values=("pilot", "live"),
        source="r",
    ),
    Column(
        "synthetic",
        "boolean",
        "True where no person gave this rating: simulated or synthesised data.",
        source="r.origin = 'simulated'",
    ),
    Column("run", "text", "Public identifier of the participant's visit (study run).", source="r.public_id"),
    Column(
        "participant",
        "text",
        "The study's pseudonym of the participant; the same person has another one in another study.",
        source="r",
    ),
    Column(
        "run_status",
        "text",
        "State of the visit.",
        values=("active", "complete", "screened_out", "withdrawn"),
        source="r.status",
    ),
    Column("language", "text", "Language the participant read.", source="r"),
)

TRIAL: tuple[Column, ...] = (
    Column(
        "trial_index",
        "integer",
        "Position of the trial in the run, from 0, practice and checks included.",
        minimum=0,
        source="a",
    ),
    Column(
        "kind",
        "text",
        "What the trial is; check is a motion check.",
        values=("practice", "main", "attention", "check"),
        source="a",
    ),
    Column("block", "integer", "Block number from 1; 0 for practice.", minimum=0, source="a"),
    Column("block_label", "text", "Level of the factor that splits the blocks, or all.", source="a"),
    Column(
        "play",
        "integer",
        "Which play of this trial: 1, or more where a failed clip was shown again.",
        minimum=1,
        source="t",
    ),
)

LEVELS = Column(
    "levels",
    "text",
    "JSON object of factor names and level names; the CSV has a column a factor instead.",
    source="c",
    json=True,
)

CLIP: tuple[Column, ...] = (
    LEVELS,
    Column("cell", "text", "Level names in factor order, joined by slashes.", source="c"),
    Column("exemplar", "integer", "Which exemplar of the cell, from 1.", minimum=1, source="c"),
    Column("profile_id", "text", "Identifier of the blink profile shown, as in the manifest.", source="c"),
    Column("stimulus", "text", "File name of the clip.", source="c.file"),
    Column("clip_sha256", "text", "SHA-256 of the clip's bytes.", source="c"),
)

TIMES: tuple[Column, ...] = (
    Column(
        "rt",
        "number",
        "Response time from the clip's last frame to the answer.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column(
        "rt_from_first_frame",
        "number",
        "Response time from the clip's first frame to the answer.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column(
        "time_elapsed",
        "number",
        "Time from the start of the run to the answer, on the participant's clock.",
        unit="ms",
        minimum=0,
        source="t",
    ),
    Column(
        "changes",
        "integer",
        "How often the answer was changed before it was confirmed.",
        minimum=0,
        source="t",
    ),
    Column(
        "comment",
        "text",
        "What the participant wrote beside the rating, where asked.",
        source="t",
        identifying=True,
    ),
)

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
        "Frames drawn more than one refresh after their time.",
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
        "refresh_rate_hz", "number", "Measured refresh rate of the screen.", unit="Hz", minimum=0, source="t"
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

EXCLUSION: tuple[Column, ...] = (
    Column("excluded", "boolean", "True where an experimenter excluded the run by hand.", source="r"),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run.", source="r", identifying=True),
)

SAVED: tuple[Column, ...] = (
    Column("saved_at", "time", "When the server stored the row (UTC, ISO 8601).", source="t"),
)

ORIGINS = ("participant", "pilot", "simulated")
"""Origins of runs that are exported; a preview's answers are not."""

ORIGIN: tuple[Column, ...] = (
    Column(
        "run_origin",
        "text",
        "Where the answers come from, fixed at the run's start: the live study, its pilot, or no person.",
        values=ORIGINS,
        source="r.origin",
    ),
    Column(
        "study_version",
        "integer",
        "Version of the study the run was made with.",
        minimum=1,
        source="v.number",
    ),
    Column(
        "data_series",
        "integer",
        "Data series of that version: versions that measure the same share one, and their answers may be "
        "pooled.",
        minimum=1,
        source="v.series",
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

VERDICTS = ("likely", "unclear", "unlikely", "not_judged")

EVIDENCE: tuple[Column, ...] = (
    Column(
        "evidence_verdict",
        "text",
        "Whether the run's answers are likely a person's; not_judged until the run is over, and where the "
        "page brought no evidence.",
        values=VERDICTS,
        source="coalesce(r.evidence_verdict, 'not_judged')",
    ),
)

CHECK: tuple[Column, ...] = (
    Column(
        "check_response",
        "integer",
        "The choice in a motion check, whose right one is expected_response; empty in other trials.",
        minimum=1,
        source="t.payload",
        member="check",
    ),
)
"""Of motion checks, in studies of every kind of trial."""

ASSUMED_REFRESH_HZ = 60
ONSET_DELAY_REFRESHES = {"Firefox/": 3, "Chrome/": 2}
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
        "a picture to the frame buffer as measured for the browser (2 refreshes in Chromium, 3 in Firefox), "
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
"""What `make scope` knows of the way from the drawing to the screen (docs/participant.md)."""
