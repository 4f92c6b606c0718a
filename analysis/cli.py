"""The command `analysis`: lists the commands; each lives with its subject and is loaded when called."""

import gc
import os

from experiments.command_groups import lazy_app
from experiments.command_line import run_command_line
from experiments.declaration import leave_descriptions_out

COMMANDS = {
    "run": (
        "analysis.commands.run",
        "Analyze a study as declared: exclusions, the paper's table, every test, and a report.",
    ),
    "anova": (
        "analysis.commands.anova",
        "ANOVA of a long table: factors within and between participants, covariates, groups of any sizes.",
    ),
    "ranks": (
        "analysis.commands.ranks",
        "Rank tests of one factor: Friedman and Wilcoxon, or Kruskal-Wallis, Mann-Whitney and Dunn.",
    ),
    "t-test": (
        "analysis.commands.ranks",
        "t tests without equal variances: Welch's ANOVA, Games and Howell's pairs, one sample, equivalence.",
    ),
    "check-paper": (
        "analysis.commands.checks",
        "Check the statistics printed in a paper: p, df and effect sizes; SE or SD; means that fit together.",
    ),
    "mixed": (
        "analysis.commands.models",
        "Linear mixed model: participants crossed with clips, slopes, Satterthwaite or Kenward-Roger tests.",
    ),
    "ordinal": (
        "analysis.commands.models",
        "Cumulative-link (ordinal) mixed model: logit, flexible thresholds, crossed effects, slopes.",
    ),
    "power": (
        "analysis.commands.synthetic",
        "Power of every effect of known size, by simulation from synthetic participants.",
    ),
    "synthesise": (
        "analysis.commands.synthetic",
        "Generate ratings of synthetic participants whose analysis gives the published figures.",
    ),
    "pairs": (
        "analysis.commands.choices",
        "Abilities of items from paired comparisons.",
    ),
    "thresholds": (
        "analysis.commands.choices",
        "Psychometric functions: thresholds with profile likelihood intervals.",
    ),
    "opinion": (
        "analysis.commands.agreement",
        "Mean opinion scores with 95% intervals; bias and inconsistency of each person (ITU-T P.910).",
    ),
    "reliability": (
        "analysis.commands.agreement",
        "Reliability of a scale: Cronbach's alpha, McDonald's omega, item statistics, scale scores.",
    ),
    "agreement": (
        "analysis.commands.agreement",
        "Agreement between people who rated the same items: intraclass correlations, Krippendorff's alpha.",
    ),
    "verify": (
        "analysis.commands.checks",
        "Verify a capsule: check every file against the list, and regenerate the report from its data.",
    ),
    "replicate": (
        "analysis.commands.checks",
        "Rebuild published studies from their raw files, and compare every printed number.",
    ),
    "columns": (
        "analysis.commands.tables",
        "Show what the columns of a table hold, and suggest the command that fits.",
    ),
    "page": (
        "analysis.commands.tables",
        "",
    ),
    "convert": (
        "analysis.commands.tables",
        "Convert a study's CSV to SPSS or Parquet, with variable and value labels.",
    ),
    "reshape": (
        "analysis.commands.tables",
        "Make a wide table long: one row per person and cell, as the other commands expect.",
    ),
    "plan": (
        "analysis.commands.plan",
        "Sample size by simulation: participants, clips and faces for a target power, and a paragraph for "
        "the plan.",
    ),
}
"""Command -> the module whose `register` adds it, and its line of help in the list."""

app = lazy_app(
    "analysis",
    "From ratings to tables: within-participant ANOVA, means, pairs, figures and one report.",
    COMMANDS,
)

OBJECTS_BETWEEN_COLLECTIONS = 100_000
"""Python's own 700 costs a tenth of a short command: loading libraries makes objects, and no garbage."""


def main() -> None:
    """Run `analysis`; bad input ends in one line on stderr and exit code 2."""
    # The matrices are small: more threads make no command faster, and waiting for work costs processor time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    leave_descriptions_out()
    run_command_line(app)
