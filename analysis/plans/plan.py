"""From a study's answers to its report: the plan of a kind of trial, and the answers that count."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module

import numpy as np
import pandas as pd

from analysis.plans.exclusions import Exclusions, apply_exclusions
from analysis.read.pool import Pool, origins, pooled
from analysis.read.reading import NoRatingsError, Reading, repeats_said
from analysis.read.study_answers import RunEvidence, StudyAnswers, with_verdicts
from analysis.report.contents import Contents
from analysis.report.evidence import evidence_section
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.kinds import scale_called
from experiments.schema.canonical import definition_sha256
from table_files import counted

# What the data of a kind of trial can be asked: a file of its name here, with `PLAN`.
#
# Nothing else joins them: the name in the declaration finds the file.


def as_they_are(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows whose answer is already a number in `response`."""
    return rows


@dataclass(frozen=True)
class Plan:
    """The analysis of a kind of trial.

    Attributes
    ----------
    reading : Reading
        The columns it needs of the kind's view.
    check : callable
        Refuses main rows that the declaration does not allow, by participant and trial; the last argument
        names the source.
    analyse : callable
        The tests, and what the report says of them.
    numbered : callable
        Adds `response`, the answer as a number, which exclusion rules and attention checks go by.
    keys : tuple of str
        Columns that tell apart the rows of one play, where a play has several.
    """

    reading: Reading
    check: "Callable[[Experiment, pd.DataFrame, str], None]"
    analyse: "Callable[[PlanRows], Contents]"
    numbered: Callable[[pd.DataFrame], pd.DataFrame] = as_they_are
    keys: tuple[str, ...] = ()


def plan_of(kind: str) -> Plan:
    """The plan of a kind of trial; InputError where it has none."""
    module = f"analysis.plans.{kind}"
    try:
        plan: Plan = import_module(module).PLAN
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        raise InputError(
            f"trials of the kind '{kind}' have no analysis yet; export the data with `server export`"
        ) from error
    return plan


# What a plan analyses: a study's answers that count, whatever its kind of trial.


@dataclass(frozen=True)
class PlanRows:
    """What a plan analyses: the main trials that count, what was left out, and every decision on the way."""

    experiment: Experiment
    source: str
    synthetic: bool
    exclusions: Exclusions
    decisions: tuple[str, ...]
    checked: StudyAnswers = field(repr=False)
    """The answers before exclusion."""
    scale: str | None = None
    """The scale to analyze, where not all are."""

    @property
    def rows(self) -> pd.DataFrame:
        """Main trials with an answer, of the runs that remain."""
        return self.exclusions.rows


# From a study's rows to those that count, whatever the kind of trial: one pool, declared exclusions.


def prepare(experiment: Experiment, plan: Plan, answers: StudyAnswers, pool: Pool = Pool()) -> PlanRows:
    """Check and exclude by the declared rules.

    Raises
    ------
    NoRatingsError
        No main trial of this origin, or nobody left after exclusion.
    InputError
        An answer that the declaration does not allow, a trial stored twice with different data.
    """
    chosen, pooling, aside = pooled(answers.rows, pool, answers.source, definition_sha256(experiment))
    rows, repeats = _without_repeats(chosen, plan.keys, answers.source)
    rows = plan.numbered(rows)
    main = _main(rows)
    plan.check(experiment, main, answers.source)
    if (main["participant"] == "").any():
        raise InputError(
            f"{answers.source}: 'participant' is empty in "
            f"{counted(int((main['participant'] == '').sum()), 'row')}"
        )
    checked = replace(answers, rows=rows)
    exclusions = apply_exclusions(experiment, checked)
    _refuse_nobody(exclusions, answers, chosen, pool)
    exclusions = replace(exclusions, set_aside=(*aside, *exclusions.set_aside))
    decisions = (*answers.decisions, *pooling, *repeats)
    return PlanRows(experiment, answers.source, checked.synthetic, exclusions, decisions, checked)


def _main(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[(rows["kind"] == "main").to_numpy()] if "kind" in rows.columns else rows


def where(rows: pd.DataFrame, position: int) -> str:
    """The participant and trial of a row, in words."""
    row = rows.iloc[position]
    trial = f", trial {row['trial_index']:g}" if "trial_index" in rows.columns else ""
    return f"participant {row['participant']}{trial}"


def refuse_unknown(rows: pd.DataFrame, column: str, known: list[str], what: str, source: str) -> None:
    """Refuse a name that is not `known`, with the nearest one; `what` says what it should have been."""
    for name in pd.unique(rows[column]):
        if name not in known:
            at = int(np.argmax((rows[column] == name).to_numpy()))
            raise InputError(
                f"{source}: {where(rows, at)}: '{name}' is not a valid {what}{did_you_mean(str(name), known)}"
            )


def _without_repeats(
    rows: pd.DataFrame, within: tuple[str, ...], source: str
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Count a trial stored twice once where its data agree; refuse it where they do not."""
    if "trial_index" not in rows.columns:
        return rows, ()
    unit = "run" if "run" in rows.columns else "participant"
    keys = [unit, "trial_index", *(name for name in ("play", *within) if name in rows.columns)]
    again = rows.duplicated(keys).to_numpy()
    if not again.any():
        return rows, ()
    differ = again & ~rows.duplicated().to_numpy()
    if differ.any():
        raise InputError(
            f"{source}: {where(rows, int(np.argmax(differ)))} occurs twice with different data; remove the "
            "wrong row"
        )
    return rows[~again], (repeats_said(int(again.sum()), "the same trials"),)


def _refuse_nobody(exclusions: Exclusions, answers: StudyAnswers, chosen: pd.DataFrame, pool: Pool) -> None:
    source = answers.source
    if not exclusions.n_runs:
        aside = f" (set aside: {'; '.join(exclusions.set_aside)})" if exclusions.set_aside else ""
        raise NoRatingsError(f"{source} has no ratings{pool} yet{aside}")
    if exclusions.rows.empty:
        excluded = "; ".join(f"{run.participant} ({', '.join(run.reasons)})" for run in exclusions.runs[:5])
        raise NoRatingsError(
            f"{source}: no participant remains after the declared exclusions: "
            f"{excluded}{_other_origins(answers.rows, chosen)}"
        )


def _other_origins(rows: pd.DataFrame, chosen: pd.DataFrame) -> str:
    """What to do where there are answers of origins that were not asked for."""
    others = sorted(set(origins(rows)) - set(origins(chosen)))
    return "; answers of other origins: " + ", ".join(f"--origin {name}" for name in others) if others else ""


# A study's answers to what its report says, by the plan of its kind of trial.


def study_contents(
    experiment: Experiment,
    answers: StudyAnswers,
    pool: Pool = Pool(),
    runs: RunEvidence | None = None,
    scale: str | None = None,
) -> Contents:
    """Analyze a study by the plan of its kind of trial.

    `runs` are verdicts and signals of a runs file; `scale` names the one to analyze, where not all are.
    """
    plan = plan_of(experiment.trial.kind)
    if scale is not None:
        scale_called(experiment, scale)
    answers = with_verdicts(answers, runs) if runs else answers
    prepared = prepare(experiment, plan, answers, pool)
    contents = plan.analyse(replace(prepared, scale=scale))
    evidence, numbers = evidence_section(prepared.checked.rows, runs, contents.synthetic)
    if evidence is None:
        return contents
    return replace(contents, evidence=evidence, numbers=contents.numbers | {"evidence": numbers})
