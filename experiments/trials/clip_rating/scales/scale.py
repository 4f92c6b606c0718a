"""What every type of scale declares, and what the rest of the program may ask of one."""

from abc import abstractmethod
from collections.abc import Iterator

from experiments.base import Declaration, Name, Translated
from experiments.trials.declared import RatedScale

SCALE_NAME = "rating"
"""Name of the scale of a [trial.scale], which has none of its own."""


class Scale(Declaration):
    """A question and the answers to it; a type of scale adds its keys, its range and a constant as `type`."""

    type: str
    """Type of scale."""
    name: Name = SCALE_NAME
    """Names the scale in the data (column `scale`); each of several needs its own."""
    question: Translated
    """What is asked, in every language."""
    reverse: bool = False
    """Whether a high answer means little of what is measured; the data keep the answer as it was given."""
    not_applicable: Translated | None = None
    """Label of an answer beside the scale, such as `cannot say`; it is stored without a number."""

    @property
    @abstractmethod
    def lowest(self) -> float:
        """The lowest answer."""

    @property
    @abstractmethod
    def highest(self) -> float:
        """The highest answer."""

    @property
    def interval(self) -> float:
        """The least difference of two answers."""
        return 1

    @property
    @abstractmethod
    def ends(self) -> tuple[Translated, Translated]:
        """Labels of the lowest and of the highest answer."""

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """Key and text of everything that participants read, the question left out."""
        if self.not_applicable:
            yield "not_applicable", self.not_applicable

    def missing_text(self) -> str | None:
        """The first text that lacks a language of the question; None where all have it."""
        for key, text in self.texts():
            missing = sorted(set(self.question) - set(text))
            if missing:
                return f"{key} of the scale {self.name} has no text in '{missing[0]}', which the question has"
        return None

    def rated(self, member: str) -> RatedScale:
        """The scale as results and analysis read it, its number at the path `member` of the stored answer."""
        low, high = self.ends
        return RatedScale(
            name=self.name,
            type=self.type,
            minimum=self.lowest,
            maximum=self.highest,
            step=self.interval,
            reverse=self.reverse,
            not_applicable=self.not_applicable is not None,
            question=self.question,
            low=low,
            high=high,
            member=member,
        )

    def said(self, language: str) -> str:
        """The scale in one line of the codebook."""
        low, high = (label.get(language, "") for label in self.ends)
        beside = self.not_applicable and f" Or: {self.not_applicable.get(language, '')} (not_applicable)."
        turned = " Reverse-keyed: a high answer means little; answers are stored as they were chosen."
        return (
            f"Scale: {self.lowest:g} ({low}) to {self.highest:g} ({high}). "
            f"Question: {self.question.get(language, '')}{beside or ''}{turned if self.reverse else ''}"
        )
