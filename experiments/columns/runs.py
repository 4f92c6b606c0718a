"""The columns of the runs CSV: one row per visit."""

from experiments.columns.base import ORIGINS, VERDICTS
from experiments.columns.column import Column


def _share(signal: str, description: str) -> Column:
    return Column(f"evidence_{signal}", "number", description, minimum=0, maximum=1)


def _amount(signal: str, description: str, unit: str | None = None) -> Column:
    return Column(f"evidence_{signal}", "number", description, unit=unit, minimum=0)


CALIBRATION_COLUMNS = (
    Column(
        "calibration_method",
        "text",
        "Object used to measure the size; empty if it was not measured.",
        values=("card", "ruler"),
    ),
    Column(
        "calibration_repeats",
        "integer",
        "Number of size measurements, including those that differed too much from the others.",
        minimum=1,
    ),
    Column(
        "calibration_spread",
        "number",
        "Quality of the size calibration: range of the accepted measurements as a share of their mean.",
        unit="%",
        minimum=0,
    ),
    Column(
        "calibration_ruler",
        "text",
        "Participant's ruler measurement of a line of known length, taken after the card.",
        values=("agrees", "no_ruler", "differs"),
    ),
    Column(
        "calibration_recheck",
        "number",
        "Largest difference found when the size was measured again during the run; empty if none was "
        "declared.",
        unit="%",
        minimum=0,
    ),
    Column(
        "distance_method",
        "text",
        "How the viewing distance was obtained; empty if it was not measured.",
        values=("blind_spot", "typed"),
    ),
    Column(
        "distance_spread_mm",
        "number",
        "Quality of the viewing distance: standard deviation over the rounds of the blind-spot test.",
        unit="mm",
        minimum=0,
    ),
    Column(
        "distance_typed_mm",
        "number",
        "Viewing distance that the participant typed, if any.",
        unit="mm",
        minimum=0,
    ),
)
"""From the latest calibration; `calibration_recheck` is from all of them."""

EVIDENCE_COLUMNS = (
    _share("tickets", "Share of answers with a valid server ticket."),
    _share(
        "digests", "Share of rated clips that the page provably downloaded, of those that could be checked."
    ),
    _amount("clip_time", "Total clip length divided by the server's time from first ticket to last answer."),
    _amount("claimed_time", "Like evidence_clip_time, plus the response times that the page reports."),
    _share("order", "Share of trials that arrived in order."),
    _share("late", "Share of answers delivered late; not evidence against a person."),
    _share("interaction", "Share of answers with a reported key or pointer press."),
    _share("trusted", "Share of presses from real input instead of a script in the page."),
    _amount("press_ms", "Median duration of a press.", "ms"),
    _amount("press_spread", "Standard deviation of the durations of presses.", "ms"),
    _amount("rt_median", "Median response time of main trials.", "ms"),
    _amount("rt_spread", "Standard deviation of the natural logarithm of the response times in ms."),
    _share("same_answer", "Share of the most frequent answer."),
    _share(
        "cycle", "Share of answers equal to the one two, three or four trials earlier (highest of the three)."
    ),
    _share("checks", "Share of attention checks answered correctly."),
    _share("motion_checks", "Share of conclusive motion checks answered correctly."),
    _amount("motion_checks_asked", "Number of conclusive motion checks."),
    _share("motion_checks_guessed", "Probability that guessing gets at least as many motion checks right."),
    _amount("motion_checks_other_way", "Motion checks answered by the alternative that the study offers."),
    _amount(
        "motion_checks_void", "Inconclusive motion checks: the presentation failed, or there was no answer."
    ),
    _share(
        "checks_guessed", "Probability that guessing gets at least as many attention and motion checks right."
    ),
)
"""One column per signal, named like the `Signals` of the server."""

FORMS = Column("forms", "text", "Answers to questionnaires; the CSV has one column per question instead.")

RUN_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("version", "integer", "Version of the study used in this run."),
    Column("data_series", "integer", "Data series of this version of the study."),
    Column("definition_sha256", "text", "SHA-256 of that version's declaration."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column(
        "participant",
        "text",
        "Pseudonym of the participant in this study.",
    ),
    Column(
        "group_name", "text", "Group of the participant: levels separated by slashes; empty without groups."
    ),
    Column(
        "phase", "text", "Whether the study was a pilot or live during this run.", values=("pilot", "live")
    ),
    Column("run_origin", "text", "Origin of the run, fixed when it starts.", values=ORIGINS),
    Column("synthetic", "boolean", "True if no person took part: simulated data."),
    Column("status", "text", "State of the visit."),
    Column("stage", "text", "Last stage reached in the visit."),
    Column("excluded", "boolean", "True if an experimenter excluded the run manually."),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run.", identifying=True),
    Column("erased", "boolean", "True if the person's data were erased on request."),
    Column("language", "text", "Language shown to the participant."),
    Column("slot", "integer", "Slot in the counterbalancing."),
    Column("seed", "integer", "Seed of the trial order."),
    Column("started_at", "time", "Start of the visit (UTC, ISO 8601)."),
    Column("consented_at", "time", "When the participant consented (UTC, ISO 8601)."),
    Column("completed_at", "time", "End of a complete visit (UTC, ISO 8601)."),
    Column("trials", "integer", "Number of trials in the run, including practice and checks."),
    FORMS,
    Column(
        "evidence_verdict",
        "text",
        "Whether a person likely gave the answers; not_judged if the page sent no evidence.",
        values=VERDICTS,
    ),
    Column("evidence_points", "number", "Sum of the points of all signals, from which the verdict follows."),
    *EVIDENCE_COLUMNS,
    Column("device", "text", "JSON object of what the browser reported about itself.", identifying=True),
    *CALIBRATION_COLUMNS,
)

# The columns of the identities CSV: the recruiter's IDs of participants.

IDENTITY_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column("participant", "text", "Pseudonym of the participant in this study, as in every other export."),
    Column("identifier", "text", "ID from the recruiter, such as PROLIFIC_PID; empty if there was none."),
    Column("link_label", "text", "Label of a personal link; empty for other links."),
    Column("parameters", "text", "JSON object of the URL parameters of the link."),
)
