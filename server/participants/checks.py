"""What the page is told of a study's motion checks: questions and choices, never an answer."""

from experiments.assignment.checks import motion_checks_by_block
from experiments.checks import CHECK_KINDS, CheckName
from experiments.definition import Experiment
from server.participants.schemas import ShownCheck, ShownChecks, ShownOtherWay
from server.trials.warnings import in_language


def shown_checks(experiment: Experiment, language: str) -> ShownChecks | None:
    """The words of the declared checks in the run's language; None where there are no checks."""
    declared = experiment.evidence.motion_checks
    if not any(motion_checks_by_block(experiment)):
        return None
    other = declared.other_way
    said = (
        {
            name: in_language(text, language, experiment.languages)
            for name, text in (("label", other.label), ("text", other.text))
        }
        if other
        else None
    )
    return ShownChecks(
        by_kind={kind: _shown(experiment, kind, language) for kind in declared.kinds},
        other_way=ShownOtherWay.model_validate(said) if said else None,
    )


def _shown(experiment: Experiment, kind: CheckName, language: str) -> ShownCheck:
    wording = experiment.evidence.motion_checks.wording
    words = next((words for words in wording if words.check == kind), None) or CHECK_KINDS[kind]
    return ShownCheck(
        question=in_language(words.question, language, experiment.languages),
        choices=[in_language(choice, language, experiment.languages) for choice in words.choices],
    )
