"""The columns of the runs CSV: one row a visit."""

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
        "What the size was measured with; empty where it was not.",
        values=("card", "ruler"),
    ),
    Column(
        "calibration_repeats",
        "integer",
        "Measurements of the size, those included that differed too much from the others.",
        minimum=1,
    ),
    Column(
        "calibration_spread",
        "number",
        "Quality of the size: largest less smallest of the measurements that count, of their mean.",
        unit="%",
        minimum=0,
    ),
    Column(
        "calibration_ruler",
        "text",
        "What the participant said of a line of known length, measured with a ruler after the card.",
        values=("agrees", "no_ruler", "differs"),
    ),
    Column(
        "calibration_recheck",
        "number",
        "Largest difference that a look at the size in mid-run found; empty where none was declared.",
        unit="%",
        minimum=0,
    ),
    Column(
        "distance_method",
        "text",
        "How the viewing distance was had; empty where it was not asked.",
        values=("blind_spot", "typed"),
    ),
    Column(
        "distance_spread_mm",
        "number",
        "Quality of the viewing distance: standard deviation of the rounds of the blind-spot test.",
        unit="mm",
        minimum=0,
    ),
    Column(
        "distance_typed_mm",
        "number",
        "Viewing distance as the participant typed it, where it was typed.",
        unit="mm",
        minimum=0,
    ),
)
"""Of the latest calibration; `calibration_recheck` is of all."""

EVIDENCE_COLUMNS = (
    _share("tickets", "Share of answers with a good ticket of the server."),
    _share("digests", "Share of rated clips shown to have been fetched, of those that could be checked."),
    _amount("clip_time", "Length of the clips over the server's time from first ticket to last answer."),
    _amount("claimed_time", "The same with the response times added that the page claims."),
    _share("order", "Share of trials that came in their order."),
    _share("late", "Share of answers delivered late; says nothing against a run."),
    _share("interaction", "Share of answers with a key or pointer press reported."),
    _share("trusted", "Share of presses made by input and not by a script in the page."),
    _amount("press_ms", "Median time from a press's down to its up.", "ms"),
    _amount("press_spread", "Standard deviation of the presses' lengths.", "ms"),
    _amount("rt_median", "Median response time of main trials.", "ms"),
    _amount("rt_spread", "Standard deviation of the natural logarithm of response times in ms."),
    _share("same_answer", "Share of the most frequent answer."),
    _share("cycle", "Share of answers equal to the one two to four trials before, at the best distance."),
    _share("checks", "Share of attention checks answered as asked."),
    _share("motion_checks", "Share of motion checks answered rightly, of those that tell something."),
    _amount("motion_checks_asked", "Motion checks that tell something."),
    _share("motion_checks_guessed", "How likely guesses are right in as many of the motion checks."),
    _amount("motion_checks_other_way", "Motion checks answered the other way that the study offers."),
    _amount("motion_checks_void", "Motion checks that tell nothing: their play failed, or none was given."),
    _share("checks_guessed", "How likely guesses are right in as many attention and motion checks together."),
)
"""One column a signal, named as `Signals` of the server names it."""

FORMS = Column("forms", "text", "Answers to questionnaires; the CSV has a column a question instead.")

RUN_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("version", "integer", "Version of the study the run was made with."),
    Column("data_series", "integer", "Data series of the run's version of the study."),
    Column("definition_sha256", "text", "SHA-256 of that version's declaration."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column(
        "participant",
        "text",
        "The study's pseudonym of the participant.",
    ),
    Column("group_name", "text", "Group of the participant, levels joined by slashes; empty without groups."),
    Column("phase", "text", "Whether the study was a pilot or live.", values=("pilot", "live")),
    Column("run_origin", "text", "Where the run came from, fixed at its start.", values=ORIGINS),
    Column("synthetic", "boolean", "True where no person took part: simulated data."),
    Column("status", "text", "State of the visit."),
    Column("stage", "text", "How far the visit came."),
    Column("excluded", "boolean", "True where an experimenter excluded the run by hand."),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run.", identifying=True),
    Column("erased", "boolean", "True where the person's data were erased on request."),
    Column("language", "text", "Language the participant read."),
    Column("slot", "integer", "Place in the counterbalancing."),
    Column("seed", "integer", "Seed of the trial order."),
    Column("started_at", "time", "Start of the visit (UTC, ISO 8601)."),
    Column("consented_at", "time", "When the participant agreed (UTC, ISO 8601)."),
    Column("completed_at", "time", "End of a complete visit (UTC, ISO 8601)."),
    Column("trials", "integer", "Trials of the run, practice and checks included."),
    FORMS,
    Column(
        "evidence_verdict",
        "text",
        "Whether the answers are likely a person's; not_judged where the page brought no evidence.",
        values=VERDICTS,
    ),
    Column("evidence_points", "number", "Points of all signals together, on which the verdict rests."),
    *EVIDENCE_COLUMNS,
    Column("device", "text", "JSON object of what the browser said of itself.", identifying=True),
    *CALIBRATION_COLUMNS,
)

# The columns of the identities CSV: who participants are to their recruiter.

IDENTITY_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column("participant", "text", "The study's pseudonym of the participant, as in every other export."),
    Column("identifier", "text", "The recruiter's id, such as PROLIFIC_PID; empty where there was none."),
    Column("link_label", "text", "Label of a personal link; empty for other links."),
    Column("parameters", "text", "JSON object of the parameters of the address."),
)
