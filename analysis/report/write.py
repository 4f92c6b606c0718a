"""One report of an analysis: HTML and Markdown, LaTeX tables, figures, and the results as JSON."""

from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from analysis.paper.document import plain
from analysis.paper.statistics import check_text
from analysis.plans.result import Analysis
from analysis.report.formats import Table, as_latex, as_markdown
from analysis.report.json_output import as_json
from analysis.report.left_out import left_out
from analysis.report.sentences import sentences
from analysis.report.tables import all_tables
from experiments.errors import InputError
from experiments.files import whole_file


@dataclass(frozen=True)
class Section:
    """A further part of the report: sensitivity analyses, published figures beside ours."""

    title: str
    text: str
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True)
class Picture:
    """A drawn figure: its file stem, its caption, and its bytes in both formats."""

    key: str
    caption: str
    svg: bytes
    png: bytes

    @property
    def data_url(self) -> str:
        """The SVG as a data URL, so that the page stands alone."""
        return "data:image/svg+xml;base64," + b64encode(self.svg).decode("ascii")


BETWEEN_METHODS = (
    " Groups (sum-to-zero contrasts) and covariates enter the multivariate linear model of the cell means; "
    "sums of squares are of type {kind}. Means weigh groups equally and are those of a participant with the "
    "mean of every covariate. Error df are participants less coefficients."
)

METHODS = (
    "Cell means are unweighted means of a participant's trials; participants with an empty cell are dropped "
    "and named. Effects are tested on orthonormal contrasts of the cell means. Multivariate: Hotelling's T², "
    "exact F on (q, N - q) df. Univariate: corrected by Greenhouse-Geisser and Huynh-Feldt. Marginal means "
    "and their errors come from participants' own marginal means. Pairs are t tests, paired within "
    "participants. Error bars of figures are 95% intervals within participants (Cousineau 2005, Morey 2008)."
)


def write_report(
    analysis: Analysis,
    folder: Path,
    sections: tuple[Section, ...] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Write every file of the report into `folder`, each whole or not at all; give back their paths.

    Files: report.html, report.md, tables.tex, results.json, and figure-*.png and .svg.
    """
    _make(folder)
    progress("figures")
    pictures = draw_all(analysis)
    progress("report")
    files: dict[str, bytes] = {}
    for picture in pictures:
        files[f"{picture.key}.svg"], files[f"{picture.key}.png"] = picture.svg, picture.png
    tables = (*all_tables(analysis), *(table for section in sections for table in section.tables))
    files["tables.tex"] = _latex(analysis, tables).encode()
    files["results.json"] = as_json(analysis).encode()
    files["report.md"] = _render("report.md.j2", analysis, pictures, sections).encode()
    files["report.html"] = _render("report.html.j2", analysis, pictures, sections).encode()
    for name, content in files.items():
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(content)
    return [folder / name for name in sorted(files)]


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {folder}: {error.strerror}") from error


def draw_all(analysis: Analysis) -> tuple[Picture, ...]:
    """Draw every figure of the analysis."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    from analysis.report.figures import as_bytes, draw, figures_of

    pictures = []
    for spec in figures_of(analysis):
        figure = draw(analysis, spec)
        pictures.append(Picture(spec.key, spec.title, as_bytes(figure, "svg"), as_bytes(figure, "png")))
    return tuple(pictures)


def _latex(analysis: Analysis, tables: tuple[Table, ...]) -> str:
    mark = "% SYNTHETIC DATA: no person gave these ratings\n" if analysis.synthetic else ""
    head = f"% {analysis.title}\n{mark}% needs \\usepackage{{booktabs}}\n\n"
    return head + "\n".join(as_latex(table) for table in tables)


def self_check(said: tuple[str, ...]) -> str:
    """What `check-paper` finds in the report's own sentences, in words."""
    result = check_text(plain("\n\n".join(said)))
    return (
        f"Checked by analysis check-paper: {len(result.statistics)} statistics read in these sentences, "
        f"{result.n_checked} recomputed from their own df, {result.n_wrong} do not fit, "
        f"{len(result.unread)} could not be read."
    )


def _render(
    template: str, analysis: Analysis, pictures: tuple[Picture, ...], sections: tuple[Section, ...]
) -> str:
    # as with matplotlib: commands that only print tables need not pay for the import
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("analysis", "report/templates"),
        autoescape=template.endswith(".html.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown_table"] = as_markdown
    tables = all_tables(analysis)
    return environment.get_template(template).render(
        analysis=analysis,
        first=tables[0],
        tables=tables[1:],
        sentences=sentences(analysis),
        self_check=self_check(sentences(analysis)),
        left_out=left_out(analysis.exclusions) if analysis.exclusions else (),
        pictures=pictures,
        sections=sections,
        methods=METHODS
        + (
            BETWEEN_METHODS.format(kind={2: "II", 3: "III"}[analysis.anova.sum_of_squares])
            if analysis.anova.between.terms[1:]
            else ""
        ),
        version=version("palpebra"),
    )
