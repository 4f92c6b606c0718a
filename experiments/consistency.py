"""Checks whether the parts of a declared experiment fit together. Every declaration is checked after reading.

`experiments.load` calls it for TOML and for stored declarations.
"""

from pydantic import ValidationError

from experiments.assignment import groups, shares
from experiments.assignment.order import motion_checks_by_block
from experiments.declaration.base import refuse_repeats, refuse_reserved
from experiments.declaration.experiment import Experiment
from experiments.declaration.tables import Assignment
from experiments.errors import did_you_mean, wrong_value
from experiments.kinds import KINDS, reserved_names
from experiments.rules import ScreenFormAnswer
from experiments.wording import language_fault, silent_on_flicker, suggested_sentence


def check_consistency(experiment: Experiment, *, has_data: bool = False) -> None:
    """Refuse an experiment whose parts do not fit together.

    Parameters
    ----------
    experiment : Experiment
        The parsed experiment: every key is valid by itself.
    has_data : bool, optional
        Whether answers were collected with it: newer rules are then not applied.

    Raises
    ------
    ValueError
        The first fault, as `path: what to do`.
    """
    _consistent(experiment, has_data)
    _assignment_fits(experiment)
    _random_factors_fit(experiment)
    _enough_check_clips(experiment)
    _consent_mentions_flicker(experiment, has_data)
    _levels_render(experiment)
    _trial_fits(experiment)
    _screening_fits_the_forms(experiment)


def _consistent(experiment: Experiment, has_data: bool) -> None:
    names = list(experiment.factor_names)
    refuse_repeats(names, "factor")
    if not has_data:
        refuse_reserved(names, reserved_names())
    refuse_repeats([form.name for form in experiment.forms], "form")
    used = {"exemplars.own_per": experiment.exemplars.own_per}
    used |= {"analysis.factors": experiment.analysis.factors, "analysis.pairs": experiment.analysis.pairs}
    used |= {"blocks.split_by": (experiment.blocks.split_by,) if experiment.blocks.split_by else ()}
    for key, mentioned in used.items():
        for name in mentioned:
            if name not in names:
                raise ValueError(f"{key}: no factor is called '{name}'{did_you_mean(name, names)}")
    for language in experiment.languages:
        if language not in experiment.texts:
            raise ValueError(f"texts.{language} is missing: languages lists '{language}'")
    if not has_data and (fault := language_fault(experiment, experiment.languages)):
        raise ValueError(fault)


def _assignment_fits(experiment: Experiment) -> None:
    kind = KINDS[experiment.trial.kind]
    dealt = f"trials of the kind {kind.name} are assigned by their own design"
    between = next((factor.name for factor in experiment.factors if factor.between), None)
    if between and not kind.groups:
        raise ValueError(f"factors: '{between}' is between participants, but {dealt}; remove `between`")
    if experiment.assignment != Assignment() and not kind.shares_clips:
        raise ValueError(f"assignment: {dealt}; remove [assignment]")
    if fault := shares.fault_of_assignment(experiment) or groups.fault_of_grouping(experiment):
        raise ValueError(fault)


def _random_factors_fit(experiment: Experiment) -> None:
    drawn = [factor.name for factor in experiment.factors if factor.random]
    if not drawn:
        return
    if not KINDS[experiment.trial.kind].random_factors:
        raise ValueError(
            f"factors: '{drawn[0]}' is random, but trials of the kind {experiment.trial.kind} do not "
            f"support random factors"
        )
    for key, mentioned in (("factors", experiment.analysis.factors), ("pairs", experiment.analysis.pairs)):
        if named := next((name for name in mentioned if name in drawn), None):
            raise ValueError(
                f"analysis.{key}: '{named}' is a random factor, over which ratings are averaged; remove it"
            )
    if len(drawn) == len(experiment.factors):
        raise ValueError(f"factors: expected at least one factor that is not random, got only '{drawn[0]}'")


def _enough_check_clips(experiment: Experiment) -> None:
    checks = experiment.evidence.motion_checks
    asked = sum(motion_checks_by_block(experiment))
    if asked > checks.clips:
        raise ValueError(
            f"evidence.motion_checks.clips: expected at least {asked}, one per check of a participant; got "
            f"{checks.clips}"
        )


def _consent_mentions_flicker(experiment: Experiment, has_data: bool) -> None:
    """For checks added by `online_recruitment`; studies that declare them manually get a warning instead."""
    if not experiment.evidence.online_recruitment or has_data:
        return
    if silent := silent_on_flicker(experiment):
        raise ValueError(
            f"texts.{silent[0]}.consent: expected a warning about flicker, because "
            f"evidence.online_recruitment shows flickering dots; add a sentence such as "
            f'"{suggested_sentence(silent[0])}"'
        )


def _levels_render(experiment: Experiment) -> None:
    for factor in experiment.factors:
        for level in factor.levels:
            try:
                level.render.applied_to(experiment.render)
            except ValidationError as error:
                reason = wrong_value(error.errors()[0])
                raise ValueError(f"factors: level '{level.name}' of '{factor.name}': {reason}") from None


def _trial_fits(experiment: Experiment) -> None:
    if fault := KINDS[experiment.trial.kind].fault(experiment):
        raise ValueError(fault)


def _screening_fits_the_forms(experiment: Experiment) -> None:
    for number, rule in enumerate(experiment.screening, start=1):
        fault = rule.fault(experiment.forms) if isinstance(rule, ScreenFormAnswer) else None
        if fault:
            raise ValueError(f"screening: rule {number}: {fault}")
