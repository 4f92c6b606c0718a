"""`analysis ranks` and `analysis t-test`: tests of one factor, or of one sample."""

from dataclasses import asdict, dataclass, replace
from functools import partial
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from analysis.commands.output import (
    JsonOption,
    LevelsOption,
    equivalence_bounds,
    save_json,
    scale_bounds,
    show_decisions,
    show_figure,
    show_tables,
    show_text,
)
from experiments.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from analysis.report.contents import Picture


FileArgument = Annotated[Path, typer.Argument(help="CSV file, one row per trial (or one per cell).")]
ParticipantOption = Annotated[str, typer.Option(help="Column that names the participant.")]
RatingOption = Annotated[str, typer.Option(help="Column with the rating.")]
WithinOption = Annotated[str | None, typer.Option(help="Column of a factor within participants.")]
BetweenOption = Annotated[str | None, typer.Option(help="Column of a factor between participants.")]
ScaleOption = Annotated[str | None, typer.Option(help="Ends of the scale, e.g. 1:7.")]


def _finite(value: float | None) -> float | None:
    if value is None or isfinite(value):
        return value
    # typer reads nan and inf as numbers, too.
    raise InputError(f"--against should be a number such as 4, got {value}")


AgainstOption = Annotated[
    float | None,
    typer.Option(
        callback=_finite,
        help="Test against this value: all participants, or those of each level of a factor.",
    ),
]
EquivalenceOption = Annotated[
    str | None,
    typer.Option(help="Bounds of equivalence of each difference, in rating units: 0.5 or -0.3,0.5."),
]


@dataclass(frozen=True)
class _Levels:
    """Participants' means: one array per level, or of everybody under the name of the rating."""

    factor: str | None
    names: tuple[str, ...]
    values: "list[NDArray[np.float64]]"
    decisions: tuple[str, ...]
    synthetic: bool


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="ranks")(ranks)
    app.command(name="t-test")(t_test)


def ranks(
    file: FileArgument,
    participant: ParticipantOption,
    rating: RatingOption,
    within: WithinOption = None,
    between: BetweenOption = None,
    against: AgainstOption = None,
    equivalence: EquivalenceOption = None,
    scale: ScaleOption = None,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Rank tests of one factor: Friedman and Wilcoxon, or Kruskal-Wallis, Mann-Whitney and Dunn.

    Trials are first averaged to one value per participant and level. Pairs are corrected by Holm and
    Bonferroni. Conover's tests of the pairs are added.

    Examples:

      analysis ranks ratings.csv --participant id --rating score --within face

      analysis ranks ratings.csv --participant id --rating score --between group --json ranks.json

      analysis ranks ratings.csv --participant id --rating score --against 4 --equivalence 0.5
    """
    # Imported when the command runs: scipy would slow down every start and all help texts.
    import numpy as np

    from analysis.ranks import rank_against, rank_between, rank_within
    from analysis.report.rank_tables import levels_table, pairs_table, ranks_text

    data = _levels_of(file, (participant, rating), (within, between), scale, levels)
    bounds = equivalence_bounds(equivalence)
    # First: with a value, a factor only names samples that are each compared with it.
    if against is not None:
        result = rank_against(data.factor, data.names, data.values, against, bounds)
    elif within:
        # Columns have equal length, since people without a level were left out.
        result = rank_within(within, data.names, np.column_stack(data.values), bounds)
    elif between:
        result = rank_between(between, data.names, data.values, bounds)
    else:
        raise InputError("expected a factor (--within or --between COLUMN), or a value (--against 4)")
    # The tests know nothing of how the table was read.
    result = replace(result, decisions=data.decisions)
    save_json(json, asdict(result), data.synthetic)
    # Before the results, since they limit what these mean.
    show_decisions(result.decisions)
    named = (result, file.stem, data.synthetic)
    show_text(ranks_text(*named))
    # Medians, as ranks are tested; t tests show means.
    show_figure(partial(_draw_levels, data, rating, "median"))
    # A comparison with a value has no test of all levels together.
    show_tables(*([levels_table(*named)] if result.test else []), pairs_table(*named))


def t_test(
    file: FileArgument,
    participant: ParticipantOption,
    rating: RatingOption,
    within: WithinOption = None,
    between: BetweenOption = None,
    against: AgainstOption = None,
    equivalence: EquivalenceOption = None,
    scale: ScaleOption = None,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """t tests without equal variances: Welch's ANOVA, Games and Howell's pairs, one sample, equivalence.

    Trials are first averaged to one value per participant (and level, with --within). Pairs within
    participants are paired t tests: use analysis anova.

    Examples:

      analysis t-test ratings.csv --participant id --rating score --between group

      analysis t-test ratings.csv --participant id --rating score --against 4

      analysis t-test ratings.csv --participant id --rating score --between group --against 0 \
          --equivalence 0.5
    """
    from analysis.report.rank_tables import mean_tests_table, means_text
    from analysis.t_tests import compare_groups, compare_with_value

    # Pairs within people would need paired tests, which the ANOVA already has.
    if against is None and within:
        raise InputError(
            "--within needs --against VALUE here; pairs of levels within participants are in analysis anova"
        )
    data = _levels_of(file, (participant, rating), (within, between), scale, levels)
    bounds = equivalence_bounds(equivalence)
    if against is not None:
        result = compare_with_value(data.factor, data.names, data.values, against, bounds)
    elif between:
        result = compare_groups(between, data.names, data.values, bounds)
    else:
        raise InputError("expected groups (--between COLUMN), or a value (--against 4)")
    result = replace(result, decisions=data.decisions)
    save_json(json, asdict(result), data.synthetic)
    show_decisions(result.decisions)
    show_text(means_text(result, file.stem, data.synthetic))
    show_figure(partial(_draw_levels, data, rating, "mean"))
    show_tables(mean_tests_table(result, file.stem, data.synthetic))


def _draw_levels(data: _Levels, rating: str, center: Literal["mean", "median"]) -> "Picture":
    from analysis.report.pictures import draw_people

    levels = [(name, values) for name, values in zip(data.names, data.values, strict=True)]
    title = f"{rating} by {data.factor}" if data.factor else rating
    return draw_people(title, rating, levels, center, data.synthetic)


def _levels_of(
    file: Path,
    columns: tuple[str, str],
    factors: tuple[str | None, str | None],
    scale: str | None,
    levels: list[str] | None,
) -> _Levels:
    """Read participants' means of each level of a factor within or between them, or of everybody."""
    from analysis.read.long_csv import design_of, read_long_table
    from analysis.within.cell_means import cell_table
    from analysis.within.level_codes import in_given_order

    # Lists, as the readers take any number of factors.
    within, between = ([name] if name else [] for name in factors)
    if within and between:
        raise InputError("expected one factor: either --within COLUMN or --between COLUMN")
    data = read_long_table(file, *columns, within, None, scale_bounds(scale), between)
    rows, ordered = in_given_order(data.rows, levels or ())
    cells = cell_table(rows, *columns, within)
    decisions = [*data.decisions, *ordered]
    # Complete cases only: rank tests within participants need every level.
    if cells.dropped:
        gone = ", ".join(one.participant for one in cells.dropped)
        decisions.append(f"excluded because a level has no rating: {gone}")
    # Without a factor everybody is one sample, named after the rating.
    names: tuple[str, ...] = cells.levels[0] if within else (columns[1],)
    y = cells.y.reshape(len(cells.participants), -1)
    values = [y[:, k] for k in range(len(names))]
    if between:
        groups = design_of(rows, columns[0], cells.participants, between, [])
        names = groups.levels[0]
        # One mean for each participant: with a factor between people, y has one column.
        values = [y[groups.codes[:, 0] == k, 0] for k in range(len(names))]
    return _Levels(factors[0] or factors[1], names, values, tuple(decisions), data.synthetic)
