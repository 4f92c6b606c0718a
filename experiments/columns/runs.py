"""The columns of the runs CSV: one row a visit."""

from experiments.columns.base import ORIGINS
from experiments.columns.column import Column

RUN_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column("participant", "text", "Identifier of the participant: link label, recruiter's id, or the run's."),
    Column("phase", "text", "Whether the study was a pilot or live.", values=("pilot", "live")),
    Column("synthetic", "boolean", "True where no person took part: simulated data."),
    Column("status", "text", "State of the visit."),
    Column("stage", "text", "How far the visit came."),
    Column("language", "text", "Language the participant read."),
    Column("version", "integer", "Version of the study the run was made with."),
    Column("definition_sha256", "text", "SHA-256 of that version's declaration."),
    Column("seed", "integer", "Seed of the trial order."),
    Column("slot", "integer", "Place in the counterbalancing."),
    Column("started_at", "time", "Start of the visit (UTC, ISO 8601)."),
    Column("consented_at", "time", "When the participant agreed (UTC, ISO 8601)."),
    Column("completed_at", "time", "End of a complete visit (UTC, ISO 8601)."),
    Column("trials", "integer", "Trials of the run, practice and checks included."),
    Column("excluded", "boolean", "True where an experimenter excluded the run by hand."),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run."),
    Column("erased", "boolean", "True where the person's data were erased on request."),
    Column("forms", "text", "JSON object of form names and their answers."),
    Column("device", "text", "JSON object of what the browser said of itself."),
    Column("recruiter_parameters", "text", "JSON object of the parameters of the recruiter's address."),
    Column("run_origin", "text", "Where the run came from, fixed at its start.", values=ORIGINS),
    Column("data_series", "integer", "Data series of the run's version of the study."),
)
