"""An experiment as a declaration: factors, exemplars, blocks, scale, texts, rules and analysis plan."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.base import Declaration, Language, LevelName, Name
from experiments.errors import did_you_mean
from experiments.forms import Form
from experiments.rendering import RenderOverrides, RenderSettings
from experiments.rules import (
    AttentionChecks,
    ExclusionRule,
    PlaybackRules,
    ScreenFormAnswer,
    ScreeningRule,
)
from experiments.trials import reserved_names
from experiments.trials.union import AnyTrial


class Level(Declaration):
    """One level of a within factor, with the label that participants never see but tables show."""

    name: LevelName
    label: str
    render: RenderOverrides = RenderOverrides()


class Factor(Declaration):
    """A within-participant factor."""

    name: Name
    label: str
    levels: Annotated[tuple[Level, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _levels_differ(self) -> Self:
        _refuse_repeats([level.name for level in self.levels], f"level of factor '{self.name}'")
        return self


class Exemplars(Declaration):
    """How many clips a cell has, and which factors bring exemplars of their own.

    Exemplar 3 of two cells shows the same blink unless the cells differ in a factor named in `own_per`.
    """

    per_cell: Annotated[int, Field(ge=1, le=1000)]
    own_per: tuple[Name, ...] = ()
    seed: int = 2011


class Blocks(Declaration):
    """How a participant's trials are cut into blocks.

    `split_by` puts each level of a factor into a block of its own; without it a block holds every clip.
    `repeats` shows each such block that often. `order` is drawn per participant: `random` shuffles the
    blocks, `alternating` cycles through the levels from a random (or counterbalanced) start,
    `counterbalanced` deals block orders evenly over participants, `fixed` keeps the declared order.
    """

    split_by: Name | None = None
    repeats: Annotated[int, Field(ge=1, le=20)] = 1
    order: Literal["random", "alternating", "counterbalanced", "fixed"] = "random"
    trial_order: Literal["random", "fixed"] = "random"
    break_seconds_min: Annotated[int, Field(ge=0, le=600)] = 0


class Practice(Declaration):
    """Practice trials before the first block; their clips are drawn over all cells by the run's seed."""

    trials: Annotated[int, Field(ge=0, le=50)] = 4


class Display(Declaration):
    """How the clip must appear: size on the screen, surround, and what the device must offer."""

    inter_ocular_mm: Annotated[float, Field(gt=0, le=500)] = 60.0
    calibrate: Literal["required", "optional", "off"] = "required"
    viewing_distance: bool = False
    full_screen: bool = True
    background: Annotated[str, Field(pattern=r"^#[0-9a-f]{6}$")] = "#808080"
    minimum_width_px: Annotated[int, Field(ge=0)] = 800
    minimum_height_px: Annotated[int, Field(ge=0)] = 500
    allow_touch: bool = True


class Session(Declaration):
    """What happens when a participant comes back."""

    resume: Literal["resume", "restart", "block"] = "resume"
    maximum_age_hours: Annotated[float, Field(gt=0)] = 72.0
    lease_minutes: Annotated[float, Field(gt=0)] = 120.0


class Texts(Declaration):
    """The pages of one language, in Markdown. `screened_out` stands in for a few words of the page's own."""

    consent: str
    instructions: str
    debrief: str
    practice: str = ""
    block_break: str = ""
    screened_out: str = ""


class AnalysisPlan(Declaration):
    """The analysis fixed before the data: factor order, the test of the table, and the pairs."""

    kind: Literal["within_anova"] = "within_anova"
    factors: tuple[Name, ...] = ()
    statistic: Literal["multivariate", "univariate"] = "multivariate"
    pairs: tuple[Name, ...] = ()
    table: Literal["two_level_factors", "pairs_and_interactions", "one_factor"] = "two_level_factors"


class Experiment(Declaration):
    """A factorial clip-rating study, complete: this is what an `expN.toml` declares."""

    name: Name
    title: str
    version: Annotated[int, Field(ge=1)] = 1
    source: str = ""
    participants: Annotated[int, Field(ge=1)] = 20
    languages: Annotated[tuple[Language, ...], Field(min_length=1)] = ("en",)
    factors: Annotated[tuple[Factor, ...], Field(min_length=1)]
    render: RenderSettings = RenderSettings()
    exemplars: Exemplars
    blocks: Blocks = Blocks()
    practice: Practice = Practice()
    trial: AnyTrial
    display: Display = Display()
    session: Session = Session()
    playback: PlaybackRules = PlaybackRules()
    attention: AttentionChecks = AttentionChecks()
    screening: tuple[ScreeningRule, ...] = ()
    exclusions: tuple[ExclusionRule, ...] = ()
    forms: tuple[Form, ...] = ()
    texts: dict[Language, Texts]
    analysis: AnalysisPlan = AnalysisPlan()

    @property
    def factor_names(self) -> tuple[str, ...]:
        """Factor names in declared order."""
        return tuple(factor.name for factor in self.factors)

    def factor(self, name: str) -> Factor:
        """Return the factor called `name`."""
        return next(factor for factor in self.factors if factor.name == name)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names = list(self.factor_names)
        _refuse_repeats(names, "factor")
        _refuse_reserved(names)
        _refuse_repeats([form.name for form in self.forms], "form")
        used = {"exemplars.own_per": self.exemplars.own_per, "analysis.factors": self.analysis.factors}
        used |= {"analysis.pairs": self.analysis.pairs}
        used |= {"blocks.split_by": (self.blocks.split_by,) if self.blocks.split_by else ()}
        for place, wanted in used.items():
            for name in wanted:
                if name not in names:
                    raise ValueError(f"{place}: no factor is called '{name}'{did_you_mean(name, names)}")
        for language in self.languages:
            if language not in self.texts:
                raise ValueError(f"texts.{language} is missing: languages lists '{language}'")
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


def _refuse_repeats(names: list[str], what: str) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ValueError(f"each {what} needs a name of its own; '{repeated[0]}' stands twice")


def _refuse_reserved(names: list[str]) -> None:
    for name in names:
        if name in reserved_names():
            raise ValueError(f"factor '{name}' has the name of a ratings column; choose another")
