"""An experiment as a declaration: factors, exemplars, blocks, scale, texts, rules and analysis plan.

Whether its parts fit one another is asked once it is read, by `experiments.consistency`.
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
