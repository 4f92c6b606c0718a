"""Columns that every kind of trial exports: the study, the run, the trial, its clip, its times, the evidence.

Names that jsPsych uses for the same thing are kept (`trial_index`, `rt`, `response`, `stimulus`,
`time_elapsed`). Aliases of the tables: s studies, v study_versions, r study_runs, a assigned_trials,
t trial_ratings, c version_clips.
"""

from collections.abc import Mapping

from experiments.columns.column import Column

ORIGINS = ("participant", "pilot", "simulated")
"""Origins of runs that are exported. Answers from previews are not exported."""
VERDICTS = ("likely", "unclear", "unlikely", "not_judged")

STUDY: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server.", source="s.name"),
    Column("experiment", "text", "Name of the declared experiment.", source="v"),
    Column(
        "study_version",
        "integer",
        "Version of the study used in this run.",
        minimum=1,
        source="v.number",
    ),
    Column(
        "data_series",
        "integer",
        "Data series of that version: versions that measure the same share one, and their answers can be "
        "pooled.",
        minimum=1,
        source="v.series",
    ),
    Column(
        "definition_sha256",
        "text",
        "SHA-256 of the experiment's declaration used in this run.",
        source="v",
    ),
)

RUN: tuple[Column, ...] = (
    Column("run", "text", "Public identifier of the participant's visit (study run).", source="r.public_id"),
    Column(
        "participant",
        "text",
        "Pseudonym of the participant in this study. The same person has different pseudonyms in different "
        "studies.",
        source="r",
    ),
    Column(
        "phase",
        "text",
        "Whether the study was a pilot or live during this run.",
        values=("pilot", "live"),
        source="r",
    ),
    Column(
        "run_origin",
        "text",
        "Where the answers come from: the live study, its pilot, or a simulation. It is fixed when the run "
        "starts.",
        values=ORIGINS,
        source="r.origin",
    ),
    Column(
        "synthetic",
        "boolean",
        "True if no person gave this rating: simulated or synthesized data.",
        source="r.origin = 'simulated'",
    ),
    Column(
        "run_status",
        "text",
        "State of the visit.",
        values=("active", "complete", "screened_out", "withdrawn"),
        source="r.status",
    ),
    Column("excluded", "boolean", "True if an experimenter excluded the run manually.", source="r"),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run.", source="r", identifying=True),
    Column(
        "evidence_verdict",
        "text",
        "Whether a person likely gave the answers of this run; not_judged until the run is over, or if the "
        "page sent no evidence.",
        values=VERDICTS,
        source="coalesce(r.evidence_verdict, 'not_judged')",
    ),
    Column("language", "text", "Language shown to the participant.", source="r"),
)

TRIAL: tuple[Column, ...] = (
    Column(
        "trial_index",
        "integer",
        "Position of the trial in the run, from 0, including practice and checks.",
        minimum=0,
        source="a",
    ),
    Column(
        "kind",
        "text",
        "Kind of trial; check is a motion check.",
        values=("practice", "main", "attention", "check"),
        source="a",
    ),
    Column("block", "integer", "Block number, from 1; 0 for practice.", minimum=0, source="a"),
    Column("block_label", "text", "Level of the factor that splits the blocks, or all.", source="a"),
    Column(
        "play",
        "integer",
        "Presentation number in this trial: 1, or more if a failed clip was shown again.",
        minimum=1,
        source="t",
    ),
)

LEVELS = Column(
    "levels",
    "text",
    "JSON object of factor names and level names; the CSV has one column per factor instead.",
    source="c",
    json=True,
)

CLIP: tuple[Column, ...] = (
    LEVELS,
    Column("cell", "text", "Level names in factor order, separated by slashes.", source="c"),
    Column("exemplar", "integer", "Which exemplar of the cell, from 1.", minimum=1, source="c"),
    Column("profile_id", "text", "Identifier of the blink profile, as in the manifest.", source="c"),
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
        "Time from the start of the run to the answer during which its page was open, on the participant's "
        "clock; on another device, or in a new tab, it continues from the last answer.",
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
        "Comment of the participant on this rating, if the study asks for one.",
        source="t",
        identifying=True,
    ),
)


SAVED: tuple[Column, ...] = (
    Column("saved_at", "time", "When the server stored the row (UTC, ISO 8601).", source="t"),
)

CHECK: tuple[Column, ...] = (
    Column(
        "check_response",
        "integer",
        "Answer to a motion check (expected_response is the correct one); empty in other trials.",
        minimum=1,
        source="t.payload",
        member="check",
    ),
)
"""For motion checks, in studies with any kind of trial."""


# The tables behind a view: those of every answer, and one clip per role in a trial.

RUN_ALIASES = frozenset("rvs")
RUN_JOINS = "JOIN study_versions v ON v.id = r.version_id\nJOIN studies s ON s.id = r.study_id\n"
"""The tables of a run after `study_runs r`."""
CLIP_TABLE = "version_clips"


def rows_of(kind: str, clips: Mapping[str, str], further: str = "") -> str:
    """The SQL after SELECT of a view of the answers of one kind of trial.

    Parameters
    ----------
    kind : str
        As the declaration names it.
    clips : mapping of str to str
        Alias of `version_clips` for each role.
    further : str, optional
        Joins of the kind's own tables, or of the parts of an answer.
    """
    joins = "".join(
        f"LEFT JOIN trial_clips {role}_clip ON {role}_clip.study_run_id = t.study_run_id "
        f"AND {role}_clip.trial_index = t.trial_index AND {role}_clip.role = '{role}'\n"
        f"LEFT JOIN {CLIP_TABLE} {alias} ON {alias}.id = {role}_clip.version_clip_id\n"
        for role, alias in clips.items()
    )
    return f"""FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
{RUN_JOINS}{joins}{further}WHERE t.kind = '{kind}' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""
