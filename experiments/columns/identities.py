"""The columns of the identities CSV: who participants are to their recruiter."""

from experiments.columns.column import Column

IDENTITY_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column("participant", "text", "The study's pseudonym of the participant, as in every other export."),
    Column("identifier", "text", "The recruiter's id, such as PROLIFIC_PID; empty where there was none."),
    Column("link_label", "text", "Label of a personal link; empty for other links."),
    Column("parameters", "text", "JSON object of the parameters of the address."),
)
