"""One report: HTML, Markdown, Word and LaTeX, tables for LaTeX, figures, and the results as JSON."""

from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.report.contents import (
    Contents,
    DrawnPart,
    Mention,
    Part,
    Picture,
    Progress,
    cited_works,
    mentions,
    numbers_of,
)
from analysis.report.formats import Table, as_markdown, as_sentence
from analysis.report.latex import NEEDS, as_document, as_latex
from analysis.report.numbers import cell_pieces, heading_pieces, note_pieces, pieces, with_minus
from analysis.report.word import as_docx
from experiments.errors import InputError
from experiments.files import json_text, whole_file
from table_files import counted

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


# Fill the templates of a report.


def fill_template(template: str, **values: Any) -> str:
    """A template of this folder with its values; HTML is escaped, every value must be given."""
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> "Environment":
    # as with matplotlib: commands that only print tables need not pay for the import
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=PackageLoader("analysis", "report/templates"),
        autoescape=select_autoescape(("html.j2",), default=False),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown_table"] = as_markdown
    environment.filters["italics"] = lambda text: _in_italics(pieces(with_minus(text)))
    environment.filters["sentence"] = as_sentence
    environment.filters["note"] = lambda text: _in_italics(note_pieces(with_minus(text)))
    environment.filters["headings"] = lambda header: [_in_italics(head) for head in heading_pieces(header)]
    environment.filters["cell"] = lambda text, numeric: _in_italics(cell_pieces(text, numeric))
    return environment


def _in_italics(split: list[tuple[str, bool]]) -> "Markup":
    """Pieces as HTML, symbols of statistics in italics."""
    from markupsafe import Markup, escape

    return Markup().join(
        Markup("<i>{}</i>").format(piece) if is_symbol else escape(piece) for piece, is_symbol in split
    )


def write_report(
    contents: Contents, folder: Path, more: bool = False, progress: Progress = lambda _: None
) -> list[Path]:
    """Write every file of the report into `folder`, each whole or not at all; give back their paths.

    Files: report.html, report.md, report.docx, report.tex, tables.tex, results.json, figure-*.png and
    .svg, and the further files of a part. `more` adds slow sections.
    """
    make_folder(folder)
    progress("figures")
    parts = tuple(_drawn(part, more, progress) for part in contents.parts)
    progress("report")
    files: dict[str, bytes] = {}
    drawn = [picture for part in parts for picture in part.pictures]
    drawn += [picture for part in parts for section in part.sections for picture in section.pictures]
    for picture in drawn:
        files[f"{picture.key}.svg"], files[f"{picture.key}.png"] = picture.svg, picture.png
    for part, made in zip(contents.parts, parts, strict=True):
        files.update(part.beside(part.key))
        for section in made.sections:
            files.update(section.beside(part.key))
    files["tables.tex"] = _latex(contents, parts).encode()
    files["report.tex"] = as_document(contents, parts, version("palpebra")).encode()
    files["results.json"] = json_text(contents.numbers).encode()
    files["report.md"] = render_report("report.md.j2", contents, parts).encode()
    files["report.html"] = render_report("report.html.j2", contents, parts).encode()
    files["report.docx"] = as_docx(contents, parts, version("palpebra"))
    for name, content in files.items():
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(content)
    return [folder / name for name in sorted(files)]


def _drawn(part: Part, more: bool, progress: Progress) -> DrawnPart:
    pictures = part.draw()
    sections = part.more(progress) if more else ()
    said = (*part.sentences, *(one for section in sections for one in section.sentences))
    tables = part.tables
    return DrawnPart(
        part.title, part.brief, tables[0], tables[1:], said, self_check(said), pictures, sections
    )


def make_folder(folder: Path) -> None:
    """Make the folder of a report; InputError where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot create the folder {folder}: {error.strerror}") from error


def _latex(contents: Contents, parts: tuple[DrawnPart, ...]) -> str:
    mark = f"% SYNTHETIC DATA: no person gave these {contents.given}\n" if contents.synthetic else ""
    head = f"% {' '.join(contents.title.split())}\n{mark}% needs {NEEDS}\n\n"
    tables = (
        table
        for part in parts
        for table in (part.first, *part.tables, *(t for section in part.sections for t in section.tables))
    )
    return head + "\n".join(as_latex(table) for table in tables)


def self_check(said: tuple[str, ...]) -> str:
    """What `check-paper` finds in the report's own sentences, in words."""
    # Here, as commands without a report need none of it.
    from analysis.paper.document import plain
    from analysis.paper.statistics import check_text

    result = check_text(plain("\n\n".join(said)))
    if not result.statistics:
        return (
            "Checked by analysis check-paper: no statistic in these sentences can be recomputed from the "
            "others."
        )
    alone = len(result.unread)
    more = f"; {alone} more cannot be recomputed from the sentence" if alone else ""
    read = counted(len(result.statistics), "statistic")
    return (
        f"Checked by analysis check-paper: {read} read in these sentences, "
        f"{result.n_checked} recomputed from their df, {result.n_wrong} inconsistent{more}."
    )


def render_report(template: str, contents: Contents, parts: tuple[DrawnPart, ...]) -> str:
    """The report as a page or as Markdown, by the name of its template."""
    from markupsafe import Markup

    numbers = numbers_of(parts, contents.evidence)
    is_page = template.endswith(".html.j2")

    def number(noun: str, key: str) -> str:
        return f"{noun} {numbers[Mention(noun, key)]}"

    def see(tables: Sequence[Table], pictures: Sequence[Picture] = ()) -> str:
        """Which tables and figures to look at, on the page with links."""
        link = Markup('<a href="#{0}">{1}</a>') if is_page else "{1}"
        return (Markup() if is_page else "").join(
            link.format(one.key, numbers[one]) if isinstance(one, Mention) else one
            for one in mentions(tables, pictures)
        )

    works = cited_works(parts, contents.methods)
    if is_page:
        references: list[str] = [_in_italics(work) for work in works]
    else:
        references = ["".join(f"*{piece}*" if wide else piece for piece, wide in work) for work in works]
    return fill_template(
        template,
        contents=contents,
        parts=parts,
        number=number,
        see=see,
        references=references,
        version=version("palpebra"),
    )
