"""What a report says, whatever the kind of trial: who was left out, and tables, sentences and figures."""

from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from analysis.report.formats import Table

if TYPE_CHECKING:
    from experiments.definition import Experiment
    from experiments.seal import Seal

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Section:
    """A further piece of the report: sensitivity analyses, checks."""

    title: str
    text: str
    tables: tuple[Table, ...] = ()


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


def _no_pictures() -> tuple[Picture, ...]:
    return ()


def _no_files(_: str) -> dict[str, bytes]:
    return {}


def _no_sections(_: Progress) -> tuple[Section, ...]:
    return ()


@dataclass(frozen=True)
class Part:
    """The answer to one question: of a study's only scale, or of one of several.

    Attributes
    ----------
    title: empty where the report has one part.
    tables: the first leads, the others are every test.
    draw: makes the figures, which takes time. more: makes further sections, which takes more.
    beside: makes files that lie beside the report, by name; it is told the key of this part.
    key: what the names of this part's files begin with, where there are several.
    """

    tables: tuple[Table, ...]
    sentences: tuple[str, ...]
    title: str = ""
    draw: Callable[[], tuple[Picture, ...]] = _no_pictures
    more: Callable[[Progress], tuple[Section, ...]] = _no_sections
    beside: Callable[[str], dict[str, bytes]] = _no_files
    key: str = ""

    def under(self, key: str, title: str) -> "Part":
        """The same as one of several parts: titled, its tables and figures in files that begin with `key`."""
        tables = tuple(replace(table, key=f"{key}-{table.key}") for table in self.tables)

        def draw() -> tuple[Picture, ...]:
            return tuple(replace(one, key=f"{key}-{one.key}") for one in self.draw())

        return replace(self, title=title, tables=tables, draw=draw, key=key)


@dataclass(frozen=True)
class Contents:
    """Everything a report says.

    Attributes
    ----------
    lead: how many participants, and what was asked of them.
    numbers: every number, as the JSON file has it.
    given: what people gave (ratings, comparisons), for the mark of synthetic data.
    evidence: whether people gave it; None where the data do not say.
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
