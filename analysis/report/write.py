"""One report: HTML, Markdown, Word and LaTeX, tables for LaTeX, figures, and the results as JSON."""

from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.report.contents import Contents, DrawnPart, Part, Progress
from analysis.report.formats import as_markdown
from analysis.report.latex import NEEDS, as_document, as_latex
from analysis.report.numbers import heading_pieces, pieces, signed_cell, with_minus
from analysis.report.word import as_docx
from experiments.errors import InputError
from experiments.files import json_text, whole_file

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
    environment.filters["headings"] = lambda header: [_in_italics(head) for head in heading_pieces(header)]
    environment.filters["signed_cell"] = signed_cell
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
    files["report.md"] = _render("report.md.j2", contents, parts).encode()
    files["report.html"] = _render("report.html.j2", contents, parts).encode()
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
    return (
        f"Checked by analysis check-paper: {len(result.statistics)} statistics read in these sentences, "
        f"{result.n_checked} recomputed from their df, {result.n_wrong} inconsistent{more}."
    )


def _render(template: str, contents: Contents, parts: tuple[DrawnPart, ...]) -> str:
    return fill_template(template, contents=contents, parts=parts, version=version("palpebra"))
