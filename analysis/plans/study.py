"""A study's answers to what its report says, by the plan of its kind of trial."""

from dataclasses import replace

from analysis.plans.plan import plan_of
from analysis.plans.prepare import prepare
from analysis.read.pool import Pool, pooled
from analysis.read.runs_file import RunEvidence, with_verdicts
from analysis.read.study_answers import StudyAnswers
from analysis.report.contents import Contents
from analysis.report.evidence import evidence_section
from experiments.definition import Experiment
from experiments.schema.canonical import definition_sha256
from experiments.trials.scales import scale_called


def study_contents(
    experiment: Experiment,
    answers: StudyAnswers,
    pool: Pool = Pool(),
    runs: RunEvidence | None = None,
    scale: str | None = None,
) -> Contents:
    """Analyse a study by the plan of its kind of trial.

    `runs` are verdicts and signals of a runs file; `scale` names the one to analyse, where not all are.
    """
    plan = plan_of(experiment.trial.kind)
    if scale is not None:
        scale_called(experiment, scale)
    answers = with_verdicts(answers, runs) if runs else answers
    contents = plan.analyse(replace(prepare(experiment, plan, answers, pool), scale=scale))
    chosen, _ = pooled(answers.rows, pool, answers.source, definition_sha256(experiment))
    evidence, numbers = evidence_section(chosen, runs, contents.synthetic)
    if evidence is None:
        return contents
    return replace(contents, evidence=evidence, numbers=contents.numbers | {"evidence": numbers})
