"""The report as a Word file, for those who write there; the same contents give the same bytes."""

import re
from datetime import UTC, datetime
from io import BytesIO
from typing import TYPE_CHECKING
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from analysis.report.contents import Contents, DrawnPart, Picture, Section
from analysis.report.formats import Table, widths_cm
from analysis.report.numbers import heading_pieces, pieces, signed_cell, with_minus

if TYPE_CHECKING:
    from docx.document import Document
    from docx.table import Table as Grid
    from docx.table import _Cell, _Row
    from docx.text.paragraph import Paragraph
    from docx.text.run import Run


EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
"""What the file says of when it was made: a clock's time would differ from run to run."""
ZIP_TIME = (1980, 1, 1, 0, 0, 0)
WIDTH_CM = 16.0
TABLE_POINTS = 8
WHOLE = 14
"""A table of more rows may be broken over pages; of its first rows one stays with the head."""
_CONTROL = re.compile("[\\x00-\\x08\\x0b\\x0c\\x0e-\\x1f\\ufffe\\uffff]")


def as_docx(contents: Contents, parts: tuple[DrawnPart, ...], version: str) -> bytes:
    """Everything that the page says, with tables that can be edited and figures as pictures.

    Parameters
    ----------
    contents : Contents
    parts : tuple of DrawnPart
        With their figures drawn.
    version : str
        Of this program, for the last line.

    Returns
    -------
    bytes
        A .docx file.
    """
    # the library takes a tenth of a second to import, which commands without a report need not pay
    import docx

    document = docx.Document()
    _set_margins(document)
    properties = document.core_properties
    properties.title, properties.author, properties.comments = _sayable(contents.title), "palpebra", ""
    properties.created = properties.modified = EPOCH
    document.add_heading(_sayable(contents.title), 0)
    if contents.synthetic:
        document.add_paragraph(f"SYNTHETIC DATA. {contents.warning}", style="Intense Quote")
    document.add_paragraph(_sayable(f"{contents.lead}, from {contents.source}."))
    for part in parts:
        _add_lines(document, "In brief", part.brief, part.title)
    _add_lines(document, "Exclusions and decisions", (*contents.left_out, *contents.decisions))
    for part in parts:
        _add_part(document, part, contents.synthetic)
    if contents.evidence:
        _add_section(document, contents.evidence, 1, contents.synthetic)
    document.add_heading("Method", 1)
    document.add_paragraph(_sayable(contents.methods))
    document.add_paragraph(f"Made by palpebra {version}.")
    return _same_bytes(document)


def _set_margins(document: "Document") -> None:
    """Lines as wide as figures are."""
    from docx.shared import Cm, Length

    section = document.sections[0]
    beside = Length(((section.page_width or Cm(21.6)) - Cm(WIDTH_CM)) // 2)
    section.left_margin = section.right_margin = beside


def _sayable(text: str) -> str:
    """The text without control characters, which no Word file may hold."""
    return _CONTROL.sub("\N{REPLACEMENT CHARACTER}", text)


def _add_lines(document: "Document", heading: str, lines: tuple[str, ...], of: str = "") -> None:
    if not lines:
        return
    document.add_heading(_sayable(f"{heading}: {of}" if of else heading), 1)
    for line in lines:
        _add_sentence(document, line)


def _add_sentence(document: "Document", text: str) -> None:
    _add_runs(document.add_paragraph(style="List Bullet"), pieces(with_minus(_sayable(text))))


def _add_runs(paragraph: "Paragraph", split: list[tuple[str, bool]], points: float | None = None) -> None:
    """Write pieces of text, symbols of statistics in italics."""
    from docx.shared import Pt

    for piece, is_symbol in split:
        run = paragraph.add_run(piece)
        run.italic = is_symbol or None
        run.font.size = None if points is None else Pt(points)


def _add_part(document: "Document", part: DrawnPart, synthetic: bool) -> None:
    level = 2 if part.title else 1
    if part.title:
        document.add_heading(_sayable(part.title), 1)
    document.add_heading("Results", level)
    _add_table(document, part.first)
    for picture in part.pictures:
        _add_picture(document, picture, synthetic)
    document.add_heading("In sentences", level)
    for sentence in part.sentences:
        _add_sentence(document, sentence)
    document.add_paragraph(part.self_check)
    if part.tables:
        document.add_heading("Every test", level)
        for table in part.tables:
            _add_table(document, table)
    for section in part.sections:
        _add_section(document, section, level, synthetic)


def _add_section(document: "Document", section: Section, level: int, synthetic: bool) -> None:
    document.add_heading(_sayable(section.title), level)
    _add_runs(document.add_paragraph(), pieces(with_minus(_sayable(section.text))))
    for picture in section.pictures:
        _add_picture(document, picture, synthetic)
    for table in section.tables:
        _add_table(document, table)


def _add_picture(document: "Document", picture: Picture, synthetic: bool) -> None:
    """A figure with its alternative text, a numbered caption, and a note that says what it shows."""
    from docx.shared import Cm

    number = len(document.inline_shapes) + 1
    shape = document.add_picture(BytesIO(picture.png), width=Cm(WIDTH_CM))
    caption = _sayable(picture.caption) + (" (synthetic data)" if synthetic else "")
    shown = _sayable(picture.alt).removesuffix(".") + "." + (" Synthetic data." if synthetic else "")
    properties = shape._inline.docPr
    properties.set("name", f"Figure {number}")
    properties.set("title", caption)
    properties.set("descr", shown)
    document.paragraphs[-1].paragraph_format.keep_with_next = True
    _add_caption(document, "Figure", number, caption, keep_with_next=True)
    said = shown.removeprefix(f"{_sayable(picture.caption)}: ")
    _add_note(document, said[:1].upper() + said[1:])


def _add_caption(document: "Document", label: str, number: int, text: str, keep_with_next: bool) -> None:
    """A caption with a number that Word counts (a SEQ field), so that it can be referred to and updated."""
    paragraph = document.add_paragraph(style="Caption")
    paragraph.add_run(f"{label} ")
    for kind in ("begin", "instruction", "separate", "number", "end"):
        run = paragraph.add_run(str(number) if kind == "number" else "")
        if kind == "instruction":
            _append(run, "w:instrText", f" SEQ {label} \\* ARABIC ")
        elif kind != "number":
            _append(run, "w:fldChar", "", fldCharType=kind)
    paragraph.add_run(f". {text}")
    paragraph.paragraph_format.keep_with_next = keep_with_next


def _append(run: "Run", name: str, text: str, **attributes: str) -> None:
    """An element inside a run that python-docx has no name for."""
    from docx.oxml import OxmlElement
    from docx.oxml.ns import qn

    element = OxmlElement(name)
    if text:
        element.text = text
        element.set(qn("xml:space"), "preserve")
    for key, value in attributes.items():
        element.set(qn(f"w:{key}"), value)
    run._r.append(element)


def _add_note(document: "Document", text: str) -> None:
    """A note under a table or a figure, as APA has it."""
    paragraph = document.add_paragraph(style="Body Text 3")
    paragraph.add_run("Note. ").italic = True
    _add_runs(paragraph, pieces(with_minus(text)))


def _describe(grid: "Grid", table: Table) -> None:
    """Alternative text of a table: its title, and what its rows and columns are."""
    columns = ", ".join(name for name in table.header if name)
    said = f"{len(table.rows)} rows; columns: {columns}."
    for name, value in (("tblCaption", _sayable(table.title)), ("tblDescription", _sayable(said))):
        _set_property(grid, name, value)


def _set_property(grid: "Grid", name: str, value: str) -> None:
    from docx.oxml import OxmlElement
    from docx.oxml.ns import qn

    element = OxmlElement(f"w:{name}")
    element.set(qn("w:val"), value)
    grid._tbl.tblPr.append(element)


def _add_table(document: "Document", table: Table) -> None:
    number = len(document.tables) + 1
    _add_caption(document, "Table", number, _sayable(table.title), keep_with_next=True)
    grid = document.add_table(rows=1 + len(table.rows), cols=len(table.header), style="Light List")
    head = heading_pieces([_sayable(text) for text in table.header])
    body = [
        [
            [(signed_cell(_sayable(text), position >= table.text_columns), False)]
            for position, text in enumerate(row)
        ]
        for row in table.rows
    ]
    for cells, row in zip(grid.rows, (head, *body), strict=True):
        for position, (cell, split) in enumerate(zip(cells.cells, row, strict=True)):
            _fill(cell, split, right=position >= table.text_columns)
    _lay_out(grid, widths_cm(table, WIDTH_CM), bool(table.notes))
    _describe(grid, table)
    if table.notes:
        _add_note(document, _sayable(" ".join(table.notes)))
    document.add_paragraph()


def _lay_out(grid: "Grid", widths: list[float], noted: bool) -> None:
    """Columns as wide as their cells need; the head on each page, and no row or short table in two halves."""
    from docx.shared import Cm

    grid.autofit = False
    rows, lengths = list(grid.rows), [Cm(width) for width in widths]
    for column, length in zip(grid.columns, lengths, strict=True):
        column.width = length
    whole = len(rows) <= WHOLE
    for number, row in enumerate(rows):
        _mark(row, "cantSplit")
        last = number + 1 == len(rows)
        keep = (whole and (noted or not last)) or number < 2 or (noted and last)
        for cell, length in zip(row.cells, lengths, strict=True):
            cell.width = length
            cell.paragraphs[0].paragraph_format.keep_with_next = keep or None
    _mark(rows[0], "tblHeader")


def _mark(row: "_Row", name: str) -> None:
    """Set a property of a row for which python-docx has no name."""
    from docx.oxml import OxmlElement

    row._tr.get_or_add_trPr().append(OxmlElement(f"w:{name}"))


def _fill(cell: "_Cell", split: list[tuple[str, bool]], right: bool) -> None:
    from docx.enum.text import WD_ALIGN_PARAGRAPH

    paragraph = cell.paragraphs[0]
    _add_runs(paragraph, split, TABLE_POINTS)
    if right:
        paragraph.alignment = WD_ALIGN_PARAGRAPH.RIGHT


def _same_bytes(document: "Document") -> bytes:
    """The file without the clock's time in its zip."""
    written, copy = BytesIO(), BytesIO()
    document.save(written)
    with ZipFile(written) as source, ZipFile(copy, "w") as target:
        for name in source.namelist():
            target.writestr(ZipInfo(name, ZIP_TIME), source.read(name), ZIP_DEFLATED)
    return copy.getvalue()
