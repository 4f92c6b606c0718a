"""What a threshold exports: the base columns, the stimulus, the answer and the estimate, one row a play.

Aliases beside those of the base columns: q series_trials, w series_answers. The clip's columns are those of
the stimulus; a standard is told by `interval`.
"""

from experiments.columns import base, playback
from experiments.columns.column import Column
from experiments.columns.tables import rows_of
from experiments.columns.view import View

SERIES: tuple[Column, ...] = (
    Column("series", "text", "Name of the adaptive series; empty in practice and checks.", source="q"),
    Column("position", "integer", "Place of the trial in its series, from 1.", minimum=1, source="q"),
    Column("value", "number", "The stimulus's number: that of its level.", source="w"),
    Column(
        "interval",
        "text",
        "Where the stimulus was: the one clip shown, or the first or second of two.",
        values=("shown", "first", "second"),
        source="q.role",
    ),
)

ANSWER: tuple[Column, ...] = (
    Column(
        "response",
        "text",
        "The answer: yes or no, or which of two clips.",
        values=("yes", "no", "first", "second"),
        source="t.payload",
        member="chosen",
    ),
    Column(
        "correct",
        "boolean",
        "The answer as analyses take it: 1 where it was yes, or named the stimulus; empty where it does not "
        "count.",
        source="w",
    ),
    Column(
        "expected_response",
        "integer",
        "The answer asked for in an attention check (1 or 2), or right in a motion check.",
        source="a",
    ),
)

ESTIMATE: tuple[Column, ...] = (
    Column(
        "counts",
        "boolean",
        "True where the answer moved the estimate: given in a main trial whose play did not fail.",
        source="w",
    ),
    Column(
        "known",
        "integer",
        "Answers of the series that the choice of this stimulus rested on.",
        minimum=0,
        source="w",
    ),
    Column(
        "ahead",
        "integer",
        "Earlier answers of the series that the choice did not know: above 0 where the page went on ahead of "
        "the server, as it does without connection.",
        minimum=0,
        source="w",
    ),
    Column("threshold", "number", "Mean of the threshold's posterior after this answer.", source="w"),
    Column(
        "threshold_sd",
        "number",
        "Standard deviation of the threshold's posterior after this answer.",
        minimum=0,
        source="w",
    ),
    Column(
        "spread",
        "number",
        "Mean of the posterior of the function's SD (normal) or slope (Weibull) after this answer.",
        minimum=0,
        source="w",
    ),
    Column(
        "entropy",
        "number",
        "Entropy of the posterior over all parameters after this answer.",
        unit="bit",
        minimum=0,
        source="w",
    ),
)

_TABLES = """\
LEFT JOIN series_trials q ON q.study_run_id = t.study_run_id AND q.trial_index = t.trial_index
LEFT JOIN series_answers w ON w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
    AND w.play = t.play
LEFT JOIN version_clips c ON c.id = w.version_clip_id
"""

THRESHOLDS = View(
    name="thresholds",
    title="Thresholds: one row a play of a trial",
    columns=(
        *base.STUDY,
        *base.RUN,
        *base.TRIAL,
        *SERIES,
        *base.CLIP,
        *ANSWER,
        *ESTIMATE,
        *base.TIMES,
        *playback.PLAYBACK,
        *playback.SCREEN,
        *base.EXCLUSION,
        *base.SAVED,
        *base.ORIGIN,
        *playback.CLOCK,
        *playback.VIEWS,
        *base.EVIDENCE,
        *base.CHECK,
        *playback.PRESENTATION,
    ),
    rows=rows_of("threshold", {}, _TABLES),
)
