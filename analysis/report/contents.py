"""What a report says, whatever the kind of trial: who was left out, and tables, sentences and figures."""

import re
from base64 import b64encode
from collections.abc import Callable, Sequence
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
    def note(self) -> str:
        """The note under the figure: what it shows, without its caption."""
        said = self.alt.removeprefix(f"{self.caption}: ").removesuffix(".") + "."
        return said[:1].upper() + said[1:]

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


# Where the text mentions tables and figures, and the works that it cites.


@dataclass(frozen=True)
class Mention:
    """The place of a table's or figure's number in a sentence."""

    noun: str
    key: str


def mentions(tables: Sequence[Table], pictures: Sequence[Picture]) -> list[str | Mention]:
    """A sentence that points to every table and figure of a section; empty without any.

    Examples
    --------
    >>> tables = [Table(key, key, (), ()) for key in "abc"]
    >>> mentions(tables, [])[1:]
    [Mention(noun='Table', key='a'), ' to ', Mention(noun='Table', key='c'), '.']
    """
    said: list[str | Mention] = []
    for noun, keys in (("Table", [one.key for one in tables]), ("Figure", [one.key for one in pictures])):
        if keys:
            said.append(f"{' and ' if said else 'See '}{noun}{'s' if len(keys) > 1 else ''}\u00a0")
            said.append(Mention(noun, keys[0]))
        if len(keys) > 1:
            said += [" to " if len(keys) > 2 else " and ", Mention(noun, keys[-1])]
    return [*said, "."] if said else []


def numbers_of(parts: Sequence[DrawnPart], evidence: Section | None) -> dict[Mention, int]:
    """Tables and figures counted in the order of the report."""
    tables: list[Table] = []
    pictures: list[Picture] = []
    for part in parts:
        tables += [part.first, *part.tables]
        pictures += part.pictures
        for section in part.sections:
            tables += section.tables
            pictures += section.pictures
    tables += evidence.tables if evidence else ()
    counted = {Mention("Table", one.key): number for number, one in enumerate(tables, 1)}
    return counted | {Mention("Figure", one.key): number for number, one in enumerate(pictures, 1)}


_WORKS = (
    "Cousineau, D. (2005). Confidence intervals in within-subject designs: A simpler solution to Loftus and "
    "Masson's method. *Tutorials in Quantitative Methods for Psychology*, *1*(1), 42–45. "
    "https://doi.org/10.20982/tqmp.01.1.p042",
    "Davidson, R. R. (1970). On extending the Bradley-Terry model to accommodate ties in paired comparison "
    "experiments. *Journal of the American Statistical Association*, *65*(329), 317–328. "
    "https://doi.org/10.1080/01621459.1970.10481082",
    "Freedman, D., & Lane, D. (1983). A nonstochastic interpretation of reported significance levels. "
    "*Journal of Business & Economic Statistics*, *1*(4), 292–298. "
    "https://doi.org/10.1080/07350015.1983.10509354",
    "Liang, K.-Y., & Zeger, S. L. (1986). Longitudinal data analysis using generalized linear models. "
    "*Biometrika*, *73*(1), 13–22. https://doi.org/10.1093/biomet/73.1.13",
    "Morey, R. D. (2008). Confidence intervals from normalized data: A correction to Cousineau (2005). "
    "*Tutorials in Quantitative Methods for Psychology*, *4*(2), 61–64. "
    "https://doi.org/10.20982/tqmp.04.2.p061",
    "Rouder, J. N., Speckman, P. L., Sun, D., Morey, R. D., & Iverson, G. (2009). Bayesian t tests for "
    "accepting and rejecting the null hypothesis. *Psychonomic Bulletin & Review*, *16*(2), 225–237. "
    "https://doi.org/10.3758/PBR.16.2.225",
    "Steiger, J. H. (2004). Beyond the F test: Effect size confidence intervals and tests of close fit in "
    "the analysis of variance and contrast analysis. *Psychological Methods*, *9*(2), 164–182. "
    "https://doi.org/10.1037/1082-989X.9.2.164",
    "Wobbrock, J. O., Findlater, L., Gergle, D., & Higgins, J. J. (2011). The aligned rank transform for "
    "nonparametric factorial analyses using only ANOVA procedures. In *Proceedings of the SIGCHI Conference "
    "on Human Factors in Computing Systems* (pp. 143–146). ACM. https://doi.org/10.1145/1978942.1978963",
    "Yuen, K. K. (1974). The two-sample trimmed t for unequal population variances. *Biometrika*, *61*(1), "
    "165–170. https://doi.org/10.1093/biomet/61.1.165",
)
_CITED = re.compile(r"\b([A-Z][a-z]+)(?:'s)?(?:,| et al\.| & [A-Z][a-z]+)*,? \(?((?:19|20)\d\d)\b")
_WORK = re.compile(r"([A-Z][a-z]+), .*?\(((?:19|20)\d\d)\)\.")


def cited_works(parts: Sequence[DrawnPart], methods: str) -> list[list[tuple[str, bool]]]:
    """The references of what the report cites, in pieces; True where one is in italics."""
    said = [methods]
    for part in parts:
        said += [note for table in (part.first, *part.tables) for note in table.notes]
        for section in part.sections:
            said += [section.text, *(note for table in section.tables for note in table.notes)]
        said += [picture.alt for picture in part.pictures]
    cited = {one.groups() for text in said for one in _CITED.finditer(text)}
    works = [work for work in _WORKS if (head := _WORK.match(work)) and head.groups() in cited]
    return [[(piece, bool(at % 2)) for at, piece in enumerate(work.split("*")) if piece] for work in works]


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
