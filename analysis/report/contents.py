"""What a report says, whatever the kind of trial: who was left out, and tables, sentences and figures."""

from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from analysis.report.formats import Table

if TYPE_CHECKING:
    from experiments.declaration.experiment import Experiment
    from experiments.seal import Seal


Progress = Callable[[str], None]


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file stem, its caption, what it shows in words, and its bytes in both formats."""

    key: str
    caption: str
    alt: str
    svg: bytes
    png: bytes

    @property
    def data_url(self) -> str:
        """The SVG as a data URL, so that the page stands alone."""
        return "data:image/svg+xml;base64," + b64encode(self.svg).decode("ascii")


_Keyed = TypeVar("_Keyed", Table, Picture)


def _no_files(_: str) -> dict[str, bytes]:
    return {}


@dataclass(frozen=True)
class Section:
    """A further piece of the report: sensitivity analyses, checks; `sentences` join those of its part."""

    title: str
    text: str
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    beside: Callable[[str], dict[str, bytes]] = _no_files
    sentences: tuple[str, ...] = ()


def _no_pictures() -> tuple[Picture, ...]:
    return ()


def _no_sections(_: Progress) -> tuple[Section, ...]:
    return ()


@dataclass(frozen=True)
class Part:
    """The answer to one question: of a study's only scale, or of one of several.

    Attributes
    ----------
    title : str
        Empty where the report has one part.
    tables : tuple of Table
        The first leads, the others are every test.
    draw : callable
        Makes the figures, which takes time.
    more : callable
        Makes further sections, which takes more.
    beside : callable
        Makes further files of the report's folder, by name; it receives the key of this part.
    key : str
        What the names of this part's files begin with, where there are several.
    brief : tuple of str
        What was found, in a few lines for the first page.
    """

    tables: tuple[Table, ...]
    sentences: tuple[str, ...]
    title: str = ""
    draw: Callable[[], tuple[Picture, ...]] = _no_pictures
    more: Callable[[Progress], tuple[Section, ...]] = _no_sections
    beside: Callable[[str], dict[str, bytes]] = _no_files
    key: str = ""
    brief: tuple[str, ...] = ()

    def under(self, key: str, title: str) -> "Part":
        """The same as one of several parts: titled, which its captions say; keys of tables and figures
        begin with `key`."""

        def tables(made: tuple[Table, ...]) -> tuple[Table, ...]:
            return tuple(replace(one, title=f"{title}: {one.title}") for one in _keyed(key, made))

        def pictures(made: tuple[Picture, ...]) -> tuple[Picture, ...]:
            return tuple(replace(one, caption=f"{title}: {one.caption}") for one in _keyed(key, made))

        def more(progress: Progress) -> tuple[Section, ...]:
            return tuple(
                replace(one, tables=tables(one.tables), pictures=pictures(one.pictures))
                for one in self.more(progress)
            )

        return replace(
            self,
            title=title,
            tables=tables(self.tables),
            draw=lambda: pictures(self.draw()),
            more=more,
            key=key,
        )


def _keyed(key: str, made: tuple[_Keyed, ...]) -> tuple[_Keyed, ...]:
    """The same, their own keys behind another."""
    return tuple(replace(one, key=f"{key}-{one.key}") for one in made)


@dataclass(frozen=True)
class Contents:
    """Everything a report says.

    Attributes
    ----------
    lead : str
        How many participants, and what was asked of them.
    numbers : dict of str to Any
        Every number, as the JSON file has it.
    given : str
        What people gave (ratings, comparisons), for the mark of synthetic data.
    evidence : Section or None
        Whether people gave it; None where the data do not say.
    """

    name: str
    title: str
    lead: str
    source: str
    synthetic: bool
    n_participants: int
    left_out: tuple[str, ...]
    decisions: tuple[str, ...]
    parts: tuple[Part, ...]
    methods: str
    numbers: dict[str, Any] = field(repr=False)
    given: str = "answers"
    evidence: Section | None = None

    @property
    def warning(self) -> str:
        """The text next to the mark of synthetic data."""
        return f"No person gave these {self.given}. Nothing here is a finding about people."


def held_against(
    contents: Contents, seal: "Seal", experiment: "Experiment", clips: str | None = None
) -> Contents:
    """The contents with a line for each deviation from the sealed plan, or one that there is none.

    `clips` is the hash of the clips that were shown, None where it is not known.
    """
    # a declaration takes a tenth of a second to import, which a plain CSV does without
    from experiments.seal import deviations_said

    said = deviations_said(seal, experiment, contents.n_participants, clips)
    numbers = {**contents.numbers, "sealed_plan": {"sha256": seal.sha256, "said": list(said)}}
    return replace(contents, decisions=(*said, *contents.decisions), numbers=numbers)


@dataclass(frozen=True)
class DrawnPart:
    """A part with its figures drawn and its further sections made, as the templates print it."""

    title: str
    brief: tuple[str, ...]
    first: Table
    tables: tuple[Table, ...]
    sentences: tuple[str, ...]
    self_check: str
    pictures: tuple[Picture, ...]
    sections: tuple[Section, ...]


# What every table, figure and sentence of made data is called.

SYNTHETIC_MARK = " [SYNTHETIC DATA]"


def mark_name(name: str, synthetic: bool) -> str:
    """The name of data, with the mark where no person gave them."""
    return f"{name}{SYNTHETIC_MARK if synthetic else ''}"


def caption(what: str, name: str, synthetic: bool) -> str:
    """Title of a table: what it shows, of which data, and that they are synthetic where they are."""
    return mark_name(f"{what}, {name}", synthetic)


def in_words(name: str) -> str:
    """The name of a scale as the head of a part has it."""
    return name[:1].upper() + name[1:].replace("_", " ")
