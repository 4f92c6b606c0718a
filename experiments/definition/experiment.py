"""An experiment as a declaration: factors, exemplars, blocks, scale, texts, rules and analysis plan."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, ValidationInfo, model_validator

from experiments.assignment import grouping, shares
from experiments.assignment.checks import motion_checks_by_block
from experiments.base import Declaration, Language, Name, Translated
from experiments.definition.analysis_plan import AnalysisPlan
from experiments.definition.assignment import Assignment
from experiments.definition.blocks import Blocks, Practice
from experiments.definition.dataset import Dataset
from experiments.definition.display import Display
from experiments.definition.evidence import Evidence
from experiments.definition.factors import Exemplars, Factor, names_listed
from experiments.definition.flicker import silent_on_flicker, suggested_sentence
from experiments.definition.forms import Form
from experiments.definition.groups import Groups
from experiments.definition.languages import fault as language_fault
from experiments.definition.names import refuse_repeats, refuse_reserved
from experiments.definition.retention import Retention
from experiments.definition.session import Session
from experiments.definition.texts import Texts
from experiments.definition.warnings import Warnings
from experiments.errors import did_you_mean
from experiments.rendering import RenderSettings
from experiments.rules import (
    AttentionChecks,
    ExclusionRule,
    PlaybackRules,
    ScreenFormAnswer,
    ScreeningRule,
)
from experiments.trials import KINDS, reserved_names
from experiments.trials.union import AnyTrial
from experiments.wrong_values import wrong_value

STORED = "stored"
"""Context of the validation of a declaration that has data: what is newly refused stays allowed."""


class Experiment(Declaration):
    """A factorial study of clips, complete: this is what an `expN.toml` declares."""

    name: Name
    """Name of the experiment in manifests, exports and file names."""
    title: str
    """Title that experimenters read, and participants where `participant_title` is not given."""
    participant_title: Translated | None = None
    """Title on the participant's first page and the browser's tab, in every language. A study's own title may
    tell what is expected of the answers."""
    version: Annotated[int, Field(ge=1)] = 1
    """The experimenter's own count of versions; nothing depends on it."""
    source: str = ""
    """Where the design comes from, such as a reference to a paper. Stands in reports."""
    participants: Annotated[int, Field(ge=1)] = 20
    """Planned number of participants, for `stimuli plan`. The study's quota is set on the server."""
    languages: Annotated[tuple[Language, ...], Field(min_length=1)] = ("en",)
    """Languages offered to participants, the first where theirs is none of them; each needs its [texts]."""
    factors: Annotated[tuple[Factor, ...], Field(min_length=1)]
    """The factors. Their levels, every one with every other, make the cells."""
    render: RenderSettings = RenderSettings()
    """How every clip is rendered, unless a level changes it."""
    exemplars: Exemplars
    """How many clips a cell has."""
    assignment: Assignment = Assignment()
    """Who sees which clips."""
    groups: Groups = Groups()
    """How participants come into the groups that factors between them make."""
    blocks: Blocks = Blocks()
    """Blocks and their order."""
    practice: Practice = Practice()
    """Practice before the first block."""
    trial: AnyTrial
    """What one trial shows and asks, by its kind."""
    display: Display = Display()
    """Size and surround of the clip, and what the device must offer."""
    session: Session = Session()
    """Coming back, and for how long a place is kept."""
    playback: PlaybackRules = PlaybackRules()
    """When a play is flagged or failed."""
    attention: AttentionChecks = AttentionChecks()
    """Attention checks between the trials."""
    evidence: Evidence = Evidence()
    """What is asked for to tell people from programs."""
    screening: tuple[ScreeningRule, ...] = ()
    """Rules that end a run while it goes on. The participant is told so, and the place is free again."""
    warnings: Warnings = Warnings()
    """Kind words to who answers without care, and when the run then ends."""
    exclusions: tuple[ExclusionRule, ...] = ()
    """Rules, fixed before the data, that leave out runs or trials when the study is analysed."""
    forms: tuple[Form, ...] = ()
    """Questionnaires before and after the trials."""
    texts: dict[Language, Texts]
    """The pages, a table a language: [texts.en]."""
    analysis: AnalysisPlan = AnalysisPlan()
    """The analysis, fixed before the data."""
    retention: Retention = Retention()
    """How long data of persons are kept."""
    dataset: Dataset = Dataset()
    """Who made the data and who may use them, for datasets that are handed on."""

    @property
    def factor_names(self) -> tuple[str, ...]:
        """Factor names in declared order."""
        return tuple(factor.name for factor in self.factors)

    def title_for(self, language: str) -> str:
        """The title that participants read in this language."""
        titles = self.participant_title or {}
        return titles.get(language) or titles.get(self.languages[0]) or self.title

    @property
    def compared_factors(self) -> tuple[str, ...]:
        """Names of the factors whose levels the analysis compares, in its order; random ones are not."""
        fixed = tuple(factor.name for factor in self.factors if not factor.random)
        return self.analysis.factors or fixed

    def factor(self, name: str) -> Factor:
        """Return the factor called `name`."""
        return next(factor for factor in self.factors if factor.name == name)

    @model_validator(mode="before")
    @classmethod
    def _factor_of_characters(cls, data: Any) -> Any:
        """`[render] character = [...]` is short for a last factor, seen whole by everybody."""
        render = data.get("render") if isinstance(data, Mapping) else None
        if not isinstance(render, Mapping) or not isinstance(render.get("character"), list | tuple):
            return data
        factors = data.get("factors", [])
        if not isinstance(factors, list | tuple):
            return data
        try:
            names = names_listed(render["character"])
        except ValueError as error:
            raise ValueError(f"render.{error}") from None
        factor = {"name": "character", "label": "Character", "character": names}
        return {**data, "factors": (*factors, factor), "render": {**render, "character": names[0]}}

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Self:
        names = list(self.factor_names)
        refuse_repeats(names, "factor")
        if not (info.context or {}).get(STORED):
            refuse_reserved(names, reserved_names())
        refuse_repeats([form.name for form in self.forms], "form")
        used = {"exemplars.own_per": self.exemplars.own_per, "analysis.factors": self.analysis.factors}
        used |= {"analysis.pairs": self.analysis.pairs}
        used |= {"blocks.split_by": (self.blocks.split_by,) if self.blocks.split_by else ()}
        for key, mentioned in used.items():
            for name in mentioned:
                if name not in names:
                    raise ValueError(f"{key}: no factor is called '{name}'{did_you_mean(name, names)}")
        for language in self.languages:
            if language not in self.texts:
                raise ValueError(f"texts.{language} is missing: languages lists '{language}'")
        if not (info.context or {}).get(STORED) and (fault := language_fault(self, self.languages)):
            raise ValueError(fault)
        return self

    @model_validator(mode="after")
    def _assignment_fits(self) -> Self:
        kind = KINDS[self.trial.kind]
        dealt = f"trials of the kind {kind.name} are dealt by their own design"
        between = next((factor.name for factor in self.factors if factor.between), None)
        if between and not kind.groups:
            raise ValueError(f"factors: '{between}' is between participants; {dealt}")
        if self.assignment != Assignment() and not kind.shares_clips:
            raise ValueError(f"assignment: {dealt}")
        if fault := shares.fault(self) or grouping.fault(self):
            raise ValueError(fault)
        return self

    @model_validator(mode="after")
    def _random_factors_fit(self) -> Self:
        drawn = [factor.name for factor in self.factors if factor.random]
        if not drawn:
            return self
        if not KINDS[self.trial.kind].random_factors:
            raise ValueError(
                f"factors: '{drawn[0]}' is random; trials of the kind {self.trial.kind} know none"
            )
        for key, mentioned in (("factors", self.analysis.factors), ("pairs", self.analysis.pairs)):
            if named := next((name for name in mentioned if name in drawn), None):
                raise ValueError(
                    f"analysis.{key}: '{named}' is a random factor, over which means are taken; leave it out"
                )
        if len(drawn) == len(self.factors):
            raise ValueError(
                f"factors: every factor is random; expected one to compare, got '{drawn[0]}' alone"
            )
        return self

    @model_validator(mode="after")
    def _enough_check_clips(self) -> Self:
        checks = self.evidence.motion_checks
        asked = sum(motion_checks_by_block(self))
        if asked > checks.clips:
            raise ValueError(
                f"evidence.motion_checks.clips: expected at least the {asked} checks that a participant is "
                f"asked, got {checks.clips}"
            )
        return self

    @model_validator(mode="after")
    def _consent_mentions_flicker(self, info: ValidationInfo) -> Self:
        """Where the switch adds motion checks; studies that declare them by hand get a warning instead."""
        if not self.evidence.online_recruitment or (info.context or {}).get(STORED):
            return self
        if silent := silent_on_flicker(self):
            raise ValueError(
                f"texts.{silent[0]}.consent: expected it to mention that clips flicker, since "
                "evidence.online_recruitment shows clips of flickering dots; add a sentence such as "
                f'"{suggested_sentence(silent[0])}"'
            )
        return self

    @model_validator(mode="after")
    def _levels_render(self) -> Self:
        for factor in self.factors:
            for level in factor.levels:
                try:
                    level.render.applied_to(self.render)
                except ValidationError as error:
                    reason = wrong_value(error.errors()[0])
                    raise ValueError(f"factors: level '{level.name}' of '{factor.name}': {reason}") from None
        return self

    @model_validator(mode="after")
    def _trial_fits(self) -> Self:
        if fault := self.trial.fault(self):
            raise ValueError(fault)
        return self

    @model_validator(mode="after")
    def _screening_fits_the_forms(self) -> Self:
        for number, rule in enumerate(self.screening, start=1):
            fault = rule.fault(self.forms) if isinstance(rule, ScreenFormAnswer) else None
            if fault:
                raise ValueError(f"screening: rule {number}: {fault}")
        return self
