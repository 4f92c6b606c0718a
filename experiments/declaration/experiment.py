"""An experiment as a declaration: factors, exemplars, blocks, scale, texts, rules and analysis plan.

`experiments.consistency` checks whether its parts fit together, after the file is read.
"""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from experiments.declaration.any_trial import AnyTrial
from experiments.declaration.base import Declaration, Language, Name, Translated
from experiments.declaration.factors import Exemplars, Factor, names_listed
from experiments.declaration.forms import Form
from experiments.declaration.rendering import RenderSettings
from experiments.declaration.tables import (
    AnalysisPlan,
    Assignment,
    Blocks,
    Dataset,
    Display,
    Evidence,
    Groups,
    Practice,
    Retention,
    Session,
    Texts,
    Warnings,
)
from experiments.rules import (
    AttentionChecks,
    ExclusionRule,
    PlaybackRules,
    ScreeningRule,
)


class Experiment(Declaration):
    """The complete declaration of a factorial clip study (an `expN.toml` file)."""

    name: Name
    """Name of the experiment in manifests, exports and file names."""
    title: str
    """Title that experimenters see. Participants see it too if `participant_title` is not set."""
    participant_title: Translated | None = None
    """Title on the participant's first page and in the browser tab, in every language. Use it if the title of
    the study reveals your hypothesis."""
    version: Annotated[int, Field(ge=1)] = 1
    """Your own version number. Nothing depends on it."""
    source: str = ""
    """Where the design comes from, such as a reference to a paper. It is shown in reports."""
    participants: Annotated[int, Field(ge=1)] = 20
    """Planned number of participants, for `stimuli plan`. The quota of the study is set on the server."""
    languages: Annotated[tuple[Language, ...], Field(min_length=1)] = ("en",)
    """Languages offered to participants. The first is used if a participant's own language is not offered.
    Each language needs its [texts]."""
    factors: Annotated[tuple[Factor, ...], Field(min_length=1)]
    """The factors. All combinations of their levels are the cells of the design."""
    render: RenderSettings = RenderSettings()
    """How clips are rendered, unless a level changes it."""
    exemplars: Exemplars
    """How many clips a cell has."""
    assignment: Assignment = Assignment()
    """Which participant sees which clips."""
    groups: Groups = Groups()
    """How participants are assigned to the groups of between-participant factors."""
    blocks: Blocks = Blocks()
    """Blocks and their order."""
    practice: Practice = Practice()
    """Practice before the first block."""
    trial: AnyTrial
    """What one trial shows and asks, by its kind."""
    display: Display = Display()
    """Size of the clip, background, and requirements for the device."""
    session: Session = Session()
    """What happens when participants return, and how long a slot is kept."""
    playback: PlaybackRules = PlaybackRules()
    """When a presentation is flagged or failed."""
    attention: AttentionChecks = AttentionChecks()
    """Attention checks between the trials."""
    evidence: Evidence = Evidence()
    """Checks that distinguish people from programs."""
    screening: tuple[ScreeningRule, ...] = ()
    """Rules that end a run early. The participant is informed, and the slot becomes free again."""
    warnings: Warnings = Warnings()
    """Friendly warnings for careless responding, and when the run then ends."""
    exclusions: tuple[ExclusionRule, ...] = ()
    """Rules that exclude runs or trials from the analysis. They are fixed before data collection."""
    forms: tuple[Form, ...] = ()
    """Questionnaires before and after the trials."""
    texts: dict[Language, Texts]
    """The pages, one table per language: [texts.en]."""
    analysis: AnalysisPlan = AnalysisPlan()
    """The analysis plan. It is fixed before data collection."""
    retention: Retention = Retention()
    """How long personal data are kept."""
    dataset: Dataset = Dataset()
    """Authors and license of the data, for shared datasets."""

    @property
    def factor_names(self) -> tuple[str, ...]:
        """Factor names in declared order."""
        return tuple(factor.name for factor in self.factors)

    def title_for(self, language: str) -> str:
        """The title that participants see in this language."""
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
        """`[render] character = [...]` is short for a last factor that everyone sees completely."""
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
