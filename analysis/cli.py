"""The command `analysis`: it only gathers the command groups."""

from experiments.command_groups import command_group
from experiments.command_line import run_command_line
from experiments.declaration import leave_descriptions_out

app = command_group(
    "From ratings to tables: within-participant ANOVA, means, pairs, figures and one report.", name="analysis"
)


def _gather() -> None:
    from analysis.commands.agreement import register_agreement, register_opinion
    from analysis.commands.anova import register_anova
    from analysis.commands.checks import register_check_paper, register_replicate, register_verify
    from analysis.commands.choices import register_pairs, register_thresholds
    from analysis.commands.models import register_models
    from analysis.commands.plan import register_plan
    from analysis.commands.ranks import register_ranks
    from analysis.commands.run import register_run
    from analysis.commands.tables import register_columns, register_convert, register_reshape

    register_run(app)
    register_anova(app)
    register_ranks(app)
    register_check_paper(app)
    register_models(app)
    register_pairs(app)
    register_thresholds(app)
    register_opinion(app)
    register_agreement(app)
    register_verify(app)
    register_replicate(app)
    register_columns(app)
    register_convert(app)
    register_reshape(app)
    register_plan(app)


_gather()


def main() -> None:
    """Run `analysis`; bad input ends in one line on stderr and exit code 2."""
    leave_descriptions_out()
    run_command_line(app)
