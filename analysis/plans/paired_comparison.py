"""The analysis of paired comparisons: abilities of the cells, what their factors do, order, ties and fit."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from analysis.pairs.abilities import ItemFactors, fit_abilities
from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons
from analysis.pairs.findings import LikelihoodRatio, findings_of, plain_reason
from analysis.pairs.likelihood import Method
from analysis.plans.plan import Plan, PlanRows, refuse_unknown
from analysis.plans.result import labels_of
from analysis.read.reading import Reading
from analysis.report.contents import Contents, Part, caption
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data, left_out, study_data
from analysis.report.numbers import apa_p, fixed, p_value
from experiments import design
from experiments.assignment.groups import groups, name_of, of_group
from experiments.declaration.experiment import Experiment
from experiments.declaration.paired_comparison import CODES, paired_comparison_of
from experiments.errors import InputError
from experiments.kinds.paired_comparison import COMPARISONS
from table_files import counted

# The comparisons of a study: its cells as items, and their levels in the compared factors.

_OUTCOMES = {"left": LEFT, "right": RIGHT, "tie": TIE}


def looked_up(column: pd.Series, values: Mapping[str, float], otherwise: float) -> np.ndarray:
    """The value of each name of a categorical column."""
    # By category and not by row: a few names, but maybe a million rows.
    of_category = np.array(
        [values.get(str(name), otherwise) for name in column.cat.categories] or [otherwise]
    )
    looked_up: np.ndarray = of_category[column.cat.codes.to_numpy()]
    return looked_up


def cells_of(experiment: Experiment) -> list[tuple[str, tuple[str, ...]]]:
    """Label and levels of every cell, in declared order."""
    levels = [tuple(level for _, level in cell) for cell in design.cells(experiment)]
    return [("/".join(names), names) for names in levels]


def comparisons_of(prepared: PlanRows) -> Comparisons:
    """The comparisons as indices; two clips of one cell say nothing about the cells and are excluded."""
    rows, decisions = prepared.rows, list(prepared.decisions)
    # As text, since the two columns may have different categories.
    same = (rows["left_cell"].astype(str) == rows["right_cell"].astype(str)).to_numpy()
    if same.any():
        decisions.append(
            f"{counted(int(same.sum()), 'comparison')} of two clips of one cell excluded from the abilities"
        )
        rows = rows[~same]
    if rows.empty:
        raise InputError(
            f"{prepared.source}: every comparison is between two clips of one cell; nothing to rank"
        )
    decisions += _arrangements(rows)
    shown = {*rows["left_cell"].astype(str), *rows["right_cell"].astype(str)}
    # In declared order, and only cells that were compared: others have no ability.
    items = tuple(name for name, _ in cells_of(prepared.experiment) if name in shown)
    position = {name: index for index, name in enumerate(items)}
    people, person = np.unique(rows["participant"].astype(str).to_numpy(), return_inverse=True)
    return Comparisons(
        items,
        looked_up(rows["left_cell"], position, -1).astype(np.int64),
        looked_up(rows["right_cell"], position, -1).astype(np.int64),
        looked_up(rows["winner"], _OUTCOMES, -1).astype(np.int64),
        person.astype(np.int64),
        tuple(str(name) for name in people),
        prepared.source,
        prepared.synthetic,
        tuple(decisions),
    )


def _arrangements(rows: pd.DataFrame) -> list[str]:
    """Where the two clips were not shown in one way throughout, how often in which."""
    if "arrangement" not in rows.columns:
        return []
    # Rows without an arrangement have an empty name.
    counts = Counter(name.replace("_", " ") for name in rows["arrangement"].astype(str) if name)
    named = [f"{number} {name}" for name, number in sorted(counts.items())]
    return (
        [f"comparisons were shown in {len(named)} arrangements: {', '.join(named)}"] if len(named) > 1 else []
    )


def factors_of(experiment: Experiment, items: tuple[str, ...]) -> ItemFactors | None:
    """The levels of the compared cells in the factors in which they differ; None where in none."""
    levels = {name: names for name, names in cells_of(experiment) if name in items}
    varied = [
        index
        for index in range(len(experiment.factors))
        # A factor with one level among the compared cells explains nothing.
        if len({names[index] for names in levels.values()}) > 1
    ]
    if not varied:
        return None
    return ItemFactors(
        tuple(experiment.factors[index].name for index in varied),
        {name: tuple(names[index] for index in varied) for name, names in levels.items()},
        experiment.name,
        {
            experiment.factors[index].name: tuple(level.name for level in experiment.factors[index].levels)
            for index in varied
        },
    )


READING = Reading(COMPARISONS, texts=("winner", "left_cell", "right_cell", "arrangement"))


def number_answers(rows: pd.DataFrame) -> pd.DataFrame:
    """Add the number of each answer, as its key has it: 1 left, 2 right, 3 tie."""
    return rows.assign(response=looked_up(rows["winner"], CODES, np.nan))


def check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    """Refuse a winner that is none, a tie where none is declared, and an unknown cell."""
    answers = ["left", "right", *(["tie"] if paired_comparison_of(experiment).ties else [])]
    # An empty winner is not a mistake of the table: a trial may have no answer.
    refuse_unknown(rows, "winner", [*answers, ""], f"answer ({', '.join(answers)})", source)
    cells = [name for name, _ in cells_of(experiment)]
    for column in ("left_cell", "right_cell"):
        refuse_unknown(rows, column, cells, "cell of this experiment", source)


def analyse(prepared: PlanRows) -> Contents:
    """Abilities of the cells and all that goes with them, in each group where groups see different cells.

    Clips that were compared within scenes are cells of the compared factor, with abilities that all scenes
    share: no comparison joins the cells of different scenes.
    """
    apart = scene_factors(prepared.experiment)
    merged = over_scenes(prepared, apart)
    if len(groups(prepared.experiment)) > 1:
        return _within_scenes(contents_of_groups(merged, analyse), prepared, apart)
    from analysis.report.pairs_contents import contents_of

    comparisons = comparisons_of(merged)
    factors = factors_of(merged.experiment, comparisons.items)
    contents = contents_of(merged, comparisons, findings_of(comparisons, factors), factors)
    if apart:
        contents = _with_agreement_of_scenes(contents, prepared, apart)
    return _within_scenes(contents, prepared, apart)


PLAN = Plan(READING, check, analyse, number_answers)


# Pairs within scenes, or within whatever else clips differ in: the abilities that all scenes share.


def scene_factors(experiment: Experiment) -> tuple[str, ...]:
    """Factors within whose levels clips are compared, such as the scene; none where all are compared."""
    pairs = paired_comparison_of(experiment).pairs
    if pairs.among != "within":
        return ()
    return tuple(one.name for one in experiment.factors if one.name != pairs.factor and not one.between)


def over_scenes(prepared: PlanRows, apart: Sequence[str]) -> PlanRows:
    """The comparisons with cells that are named, and declared, without the factors of `apart`."""
    if not apart:
        return prepared
    experiment = prepared.experiment
    kept = [index for index, factor in enumerate(experiment.factors) if factor.name not in apart]
    named = {name: "/".join(levels[index] for index in kept) for name, levels in cells_of(experiment)}
    rows = prepared.rows.assign(
        **{
            column: pd.Categorical(prepared.rows[column].astype(str).map(named))
            for column in ("left_cell", "right_cell")
        }
    )
    return replace(
        prepared,
        experiment=experiment.model_copy(
            update={"factors": tuple(experiment.factors[index] for index in kept)}
        ),
        exclusions=replace(prepared.exclusions, rows=rows),
    )


def _within_scenes(contents: Contents, prepared: PlanRows, apart: Sequence[str]) -> Contents:
    """The report, with what its abilities are common to."""
    if not apart:
        return contents
    return replace(
        contents,
        methods=COMMON.format(what=_named(prepared, apart)) + contents.methods,
        numbers=contents.numbers | {"within": list(apart)},
    )


def _named(prepared: PlanRows, factors: Sequence[str]) -> str:
    labels = labels_of(prepared.experiment)
    return " and ".join(labels.factor(name) for name in factors)


def _with_agreement_of_scenes(contents: Contents, prepared: PlanRows, apart: Sequence[str]) -> Contents:
    """The report with a test that all scenes have the same abilities."""
    experiment = prepared.experiment
    at = [index for index, factor in enumerate(experiment.factors) if factor.name in apart]
    scene = prepared.rows["left_cell"].astype(str).map(lambda cell: [cell.split("/")[index] for index in at])
    every = [
        comparisons_of(replace(prepared, exclusions=replace(prepared.exclusions, rows=rows)))
        for _, rows in prepared.rows.groupby(scene.map("/".join), observed=True)
    ]
    kept = [index for index in range(len(experiment.factors)) if index not in at]
    test, reason = _tested_agreement([_without(one, kept) for one in every], "scenes")
    what = f"levels of {_named(prepared, apart)}"
    return replace(
        contents,
        parts=(*contents.parts, _agreement_part(test, reason, contents.name, prepared.synthetic, what)),
        methods=AGREEMENT + contents.methods,
        numbers=contents.numbers | _agreement_numbers(test, reason),
    )


COMMON = "Clips were compared only within the same level of {what}. Abilities are common to all levels. "
AGREEMENT = (
    "Agreement of these levels is tested by a likelihood ratio: separate abilities in each level against "
    "common abilities. "
)


# Paired comparisons of groups of participants: the abilities in each group, and whether groups agree.

METHODS = (
    "Each group is analyzed separately, because nobody compares clips from different groups. Agreement of "
    "groups is tested by a likelihood ratio: separate abilities in each group against common abilities. "
)


def contents_of_groups(prepared: PlanRows, analyse: Callable[[PlanRows], Contents]) -> Contents:
    """A part of the report for each group, and one that compares them; `analyse` is of one group."""
    experiment, labels = prepared.experiment, labels_of(prepared.experiment)
    made: list[tuple[str, Contents, Comparisons]] = []
    parts: list[Part] = []
    # In declared order, so that parts of the report are in the same order each time.
    for levels in groups(experiment):
        mine = _of_group(prepared, of_group(experiment, levels))
        name = name_of(levels)
        if mine.rows.empty:
            parts.append(Part((), (f"The group {name} has no comparisons yet.",), name))
            continue
        contents = analyse(mine)
        title = ", ".join(f"{labels.factor(factor)}: {labels.level(factor, one)}" for factor, one in levels)
        # The key becomes a part of file names, in which a slash is a folder.
        parts += [part.under(name.replace("/", "-"), title) for part in contents.parts]
        made.append((name, contents, comparisons_of(mine)))
    if not made:
        raise InputError(
            f"{experiment.name}: no comparison has items of a declared group; check that the data belong to "
            "this version of the study"
        )
    agreement, reason = _agreement(experiment, [comparisons for *_, comparisons in made])
    people = prepared.rows["participant"].astype(str).nunique()
    # Methods and labels are the same in every group.
    first = made[0][1]
    return replace(
        first,
        title=experiment.title,
        lead=(
            f"{counted(people, 'participant')} in {counted(len(made), 'group')}, "
            f"{counted(len(prepared.rows), 'comparison')}"
        ),
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        # Each decision once: decisions about the whole table come from every group.
        decisions=tuple(dict.fromkeys(said for _, one, _ in made for said in one.decisions)),
        parts=(*parts, _agreement_part(agreement, reason, experiment.name, prepared.synthetic)),
        methods=METHODS + first.methods,
        numbers=_numbers(prepared, people, [(name, one) for name, one, _ in made], agreement, reason),
    )


def _of_group(prepared: PlanRows, experiment: Experiment) -> PlanRows:
    """What the participants of one group answered; the experiment is that of the group."""
    cells = ["/".join(level for _, level in cell) for cell in design.cells(experiment)]
    rows = prepared.rows
    rows = rows[rows["left_cell"].astype(str).isin(cells).to_numpy()]
    return replace(prepared, experiment=experiment, exclusions=replace(prepared.exclusions, rows=rows))


def _agreement(
    experiment: Experiment, every: Sequence[Comparisons]
) -> tuple[LikelihoodRatio | None, str | None]:
    """Test that all groups have the same abilities; the reason where it cannot be tested.

    With the maximum log likelihood L_g of each of G groups and L of all groups by one set of abilities, the
    statistic is

    .. math::

        \\chi^2 = 2 \\Big(\\sum_g L_g - L\\Big) \\tag{1}

    with (G - 1) p degrees of freedom, p being the parameters of one set: abilities but one, and ties.
    """
    if len(every) < 2:
        return None, "only one group has comparisons"
    # Cells of different groups are the same once the factors between groups are left out.
    within = [index for index, factor in enumerate(experiment.factors) if not factor.between]
    return _tested_agreement([_without(one, within) for one in every], "groups")


def _tested_agreement(named: Sequence[Comparisons], what: str) -> tuple[LikelihoodRatio | None, str | None]:
    """The likelihood ratio of equation (1) of `_agreement`, of comparisons whose items have common names."""
    if len(named) < 2:
        return None, f"only one of the {what} has comparisons"
    # Common abilities need common cells.
    if any(set(one.items) != set(named[0].items) for one in named):
        return None, f"the {what} compared different cells"
    pooled = _together(named)
    # All models must have the same parameters: with ties in one, ties in all.
    method: Method = "davidson" if pooled.ties else "bradley-terry"
    try:
        own = [fit_abilities(one, method) for one in named]
        same = fit_abilities(pooled, method)
    except InputError as error:
        return None, plain_reason(str(error), pooled.source)
    # Rounding may put the sum just below the common fit.
    chi2 = max(0.0, 2 * (sum(one.log_likelihood for one in own) - same.log_likelihood))
    df = (len(named) - 1) * (len(pooled.items) - 1 + (method == "davidson"))
    return LikelihoodRatio(chi2, df, float(stats.chi2.sf(chi2, df))), None


def _without(one: Comparisons, kept: list[int]) -> Comparisons:
    """The cells named by their levels in the factors at these places."""
    return replace(one, items=tuple("/".join(item.split("/")[index] for index in kept) for item in one.items))


def _together(every: Sequence[Comparisons]) -> Comparisons:
    """The comparisons of all groups, items in the order of the first one."""
    first = every[0]
    # Groups list their items in different orders.
    codes = [np.array([first.items.index(item) for item in one.items]) for one in every]
    return replace(
        first,
        left=np.concatenate([code[one.left] for code, one in zip(codes, every, strict=True)]),
        right=np.concatenate([code[one.right] for code, one in zip(codes, every, strict=True)]),
        outcome=np.concatenate([one.outcome for one in every]),
        # The test needs no raters, and the numbers of raters repeat between groups.
        participant=None,
        participants=(),
    )


def _agreement_part(
    test: LikelihoodRatio | None, reason: str | None, name: str, synthetic: bool, what: str = "groups"
) -> Part:
    title = f"Agreement of the {what}"
    if test is None:
        return Part((), (f"{title} was not tested: {reason}.",), title)
    verdict = "differed" if test.p < 0.05 else "did not differ significantly"
    said = f"Abilities {verdict} between the {what}, χ²({test.df}) = {fixed(test.chi2)}, {apa_p(test.p)}."
    row = (f"Same abilities in all {what}", fixed(test.chi2), str(test.df), p_value(test.p))
    header = ("Hypothesis", "χ²", "df", "p")
    table = Table("agreement-of-groups", caption(title, name, synthetic), header, (row,), 1)
    return Part((table,), (said,), title)


def _numbers(
    prepared: PlanRows,
    people: int,
    of_groups: Sequence[tuple[str, Contents]],
    test: LikelihoodRatio | None,
    reason: str | None,
) -> dict[str, Any]:
    return {
        **study_data(prepared, people),
        "groups": [{"group": name, **contents.numbers} for name, contents in of_groups],
        **_agreement_numbers(test, reason),
        "exclusions": exclusions_data(prepared.exclusions),
    }


def _agreement_numbers(test: LikelihoodRatio | None, reason: str | None) -> dict[str, Any]:
    return {
        "agreement": None if test is None else {"chi2": test.chi2, "df": test.df, "p": test.p},
        "agreement_reason": reason,
    }
