"""The report as a Word file, for those who write there; the same contents give the same bytes."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from io import BytesIO
from typing import TYPE_CHECKING
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from analysis.report.contents import (
    Contents,
    DrawnPart,
    Mention,
    Picture,
    Section,
    cited_works,
    mentions,
    numbers_of,
)
from analysis.report.formats import Table, as_sentence, widths_cm
from analysis.report.numbers import (
    cell_pieces,
    heading_pieces,
    note_pieces,
    pieces,
    unbroken,
    with_minus,
)
from table_files import counted

if TYPE_CHECKING:
    from docx.document import Document
    from docx.oxml.xmlchemy import BaseOxmlElement
    from docx.table import Table as Grid
    from docx.table import _Cell, _Row
    from docx.text.paragraph import Paragraph
    from docx.text.run import Run


EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
"""What the file says of when it was made: a clock's time would differ from run to run."""
ZIP_TIME = (1980, 1, 1, 0, 0, 0)
WIDTH_CM = 16.0
FONT = "Times New Roman"
TABLE_POINTS = 9
WHOLE = 26
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
    numbers = numbers_of(parts, contents.evidence)
    _set_margins(document)
    _set_styles(document)
    _number_pages(document)
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
        _add_part(document, part, contents.synthetic, numbers)
    if contents.evidence:
        _add_section(document, contents.evidence, 1, contents.synthetic, numbers)
    document.add_heading("Method", 1)
    _add_noted(document, contents.methods)
    _add_references(document, cited_works(parts, contents.methods))
    document.add_paragraph(f"Made by palpebra {version}.")
    return _same_bytes(document)


def _set_margins(document: "Document") -> None:
    """Lines as wide as figures are."""
    from docx.shared import Cm, Length

    section = document.sections[0]
    beside = Length(((section.page_width or Cm(21.6)) - Cm(WIDTH_CM)) // 2)
    section.left_margin = section.right_margin = beside


def _set_styles(document: "Document") -> None:
    """The type of a manuscript in APA style: black Times, bold heads, plain captions."""
    from docx.enum.style import WD_STYLE_TYPE
    from docx.enum.text import WD_ALIGN_PARAGRAPH
    from docx.oxml.ns import qn
    from docx.shared import Pt, RGBColor

    sizes = {"Normal": 11, "Title": 14, "Heading 1": 12, "Heading 2": 11, "Caption": 11}
    sizes |= {"Intense Quote": 11, "Body Text 3": 9}
    for name, points in sizes.items():
        style = document.styles[name]
        fonts = style.element.get_or_add_rPr().get_or_add_rFonts()
        # a font of the theme goes before one by name
        for attribute in ("asciiTheme", "hAnsiTheme", "eastAsiaTheme", "cstheme"):
            fonts.attrib.pop(qn(f"w:{attribute}"), None)
        style.font.name, style.font.size, style.font.color.rgb = FONT, Pt(points), RGBColor(0, 0, 0)
        style.font.bold = name not in ("Normal", "Caption", "Body Text 3")
        style.font.italic = False
        for border in style.element.xpath("./w:pPr/w:pBdr"):
            border.getparent().remove(border)
    cells = document.styles.add_style("Table Cell", WD_STYLE_TYPE.PARAGRAPH)
    cells.base_style = document.styles["Normal"]
    cells.font.size, cells.paragraph_format.space_after = Pt(TABLE_POINTS), Pt(0)
    cells.paragraph_format.line_spacing = 1.0
    document.styles["Title"].paragraph_format.alignment = WD_ALIGN_PARAGRAPH.CENTER


def _number_pages(document: "Document") -> None:
    from docx.enum.text import WD_ALIGN_PARAGRAPH

    paragraph = document.sections[0].header.paragraphs[0]
    paragraph.alignment = WD_ALIGN_PARAGRAPH.RIGHT
    _add_field(paragraph, " PAGE ", "1")


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
    _add_runs(
        document.add_paragraph(style="List Bullet"), pieces(unbroken(with_minus(_sayable(as_sentence(text)))))
    )


def _add_noted(document: "Document", text: str) -> "Paragraph":
    """A paragraph about statistics, their symbols in italics."""
    paragraph = document.add_paragraph()
    _add_runs(paragraph, note_pieces(unbroken(with_minus(_sayable(text)))))
    return paragraph


def _add_references(document: "Document", works: list[list[tuple[str, bool]]]) -> None:
    from docx.shared import Cm

    if works:
        document.add_heading("References", 1)
    for work in works:
        paragraph = document.add_paragraph()
        paragraph.paragraph_format.left_indent = Cm(1.27)
        paragraph.paragraph_format.first_line_indent = Cm(-1.27)
        _add_runs(paragraph, work)


def _add_runs(paragraph: "Paragraph", split: list[tuple[str, bool]]) -> None:
    """Write pieces of text, symbols of statistics in italics."""
    for piece, is_symbol in split:
        paragraph.add_run(piece).italic = is_symbol or None


def _add_part(document: "Document", part: DrawnPart, synthetic: bool, numbers: dict[Mention, int]) -> None:
    level = 2 if part.title else 1
    if part.title:
        document.add_heading(_sayable(part.title), 1)
    document.add_heading("Results", level)
    _add_mentions(document.add_paragraph(), mentions([part.first], part.pictures), numbers)
    _add_table(document, part.first)
    for picture in part.pictures:
        _add_picture(document, picture, synthetic)
    document.add_heading("In sentences", level)
    for sentence in part.sentences:
        _add_sentence(document, sentence)
    _add_noted(document, part.self_check)
    if part.tables:
        document.add_heading("Every test", level)
        _add_mentions(document.add_paragraph(), mentions(part.tables, ()), numbers)
        for table in part.tables:
            _add_table(document, table)
    for section in part.sections:
        _add_section(document, section, level, synthetic, numbers)


def _add_section(
    document: "Document", section: Section, level: int, synthetic: bool, numbers: dict[Mention, int]
) -> None:
    document.add_heading(_sayable(section.title), level)
    paragraph = _add_noted(document, section.text)
    if section.tables or section.pictures:
        paragraph.add_run(" ")
        _add_mentions(paragraph, mentions(section.tables, section.pictures), numbers)
    for picture in section.pictures:
        _add_picture(document, picture, synthetic)
    for table in section.tables:
        _add_table(document, table)


def _add_picture(document: "Document", picture: Picture, synthetic: bool) -> None:
    """A figure with its alternative text, a numbered caption, and a note that says what it shows."""
    from docx.shared import Cm

    number = len(document.inline_shapes) + 1
    caption = _sayable(picture.caption) + (" (synthetic data)" if synthetic else "")
    shown = _sayable(picture.alt).removesuffix(".") + "." + (" Synthetic data." if synthetic else "")
    _add_caption(document, "Figure", number, caption)
    shape = document.add_picture(BytesIO(picture.png), width=Cm(WIDTH_CM))
    properties = shape._inline.docPr
    properties.set("name", f"Figure {number}")
    properties.set("title", caption)
    properties.set("descr", shown)
    document.paragraphs[-1].paragraph_format.keep_with_next = True
    _add_note(document, _sayable(picture.note) + (" Synthetic data." if synthetic else ""))


def _add_caption(document: "Document", label: str, number: int, text: str) -> None:
    """A number in bold that Word counts (a SEQ field), and the title in italics in the next line.

    A bookmark around the number lets the text refer to it.
    """
    paragraph = document.add_paragraph(style="Caption")
    paragraph.add_run(f"{label} ").bold = True
    mark = {"id": str(2 * number + (label == "Figure")), "name": f"{label}{number}"}
    _append(paragraph._p, "w:bookmarkStart", "", **mark)
    for run in _add_field(paragraph, f" SEQ {label} \\* ARABIC ", str(number)):
        run.bold = True
    _append(paragraph._p, "w:bookmarkEnd", "", id=mark["id"])
    paragraph.add_run().add_break()
    paragraph.add_run(text).italic = True
    paragraph.paragraph_format.keep_with_next = True


def _add_mentions(paragraph: "Paragraph", said: Sequence[str | Mention], numbers: dict[Mention, int]) -> None:
    """A sentence whose numbers of tables and figures follow their captions (REF fields)."""
    for piece in said:
        if isinstance(piece, Mention):
            number = numbers[piece]
            _add_field(paragraph, f" REF {piece.noun}{number} \\h ", str(number))
        else:
            paragraph.add_run(piece)


def _add_field(paragraph: "Paragraph", instruction: str, shown: str) -> list["Run"]:
    """A field that Word computes, with what it shows until then."""
    runs = []
    for kind in ("begin", "instruction", "separate", "shown", "end"):
        run = paragraph.add_run(shown if kind == "shown" else "")
        if kind == "instruction":
            _append(run._r, "w:instrText", instruction)
        elif kind != "shown":
            _append(run._r, "w:fldChar", "", fldCharType=kind)
        runs.append(run)
    return runs


def _append(parent: "BaseOxmlElement", tag: str, text: str, **attributes: str) -> None:
    """An element that python-docx has no name for, as the last one of another."""
    from docx.oxml import OxmlElement
    from docx.oxml.ns import qn

    element = OxmlElement(tag)
    if text:
        element.text = text
        element.set(qn("xml:space"), "preserve")
    for key, value in attributes.items():
        element.set(qn(f"w:{key}"), value)
    parent.append(element)


def _add_note(document: "Document", text: str) -> None:
    """A note under a table or a figure, as APA has it."""
    paragraph = document.add_paragraph(style="Body Text 3")
    paragraph.add_run("Note. ").italic = True
    _add_runs(paragraph, note_pieces(unbroken(with_minus(text))))


def _describe(grid: "Grid", table: Table) -> None:
    """Alternative text of a table: its title, and what its rows and columns are."""
    columns = ", ".join(name for name in table.header if name)
    said = f"{counted(len(table.rows), 'row')}; columns: {columns}."
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
    _add_caption(document, "Table", number, _sayable(table.title))
    grid = document.add_table(rows=1 + len(table.rows), cols=len(table.header))
    head = heading_pieces([_sayable(text) for text in table.header])
    body = [
        [cell_pieces(_sayable(text), position >= table.text_columns) for position, text in enumerate(row)]
        for row in table.rows
    ]
    style = document.styles["Table Cell"].style_id
    for cells, row in zip(grid.rows, (head, *body), strict=True):
        for position, (cell, split) in enumerate(zip(cells.cells, row, strict=True)):
            _fill(cell, split, style, right=position >= table.text_columns)
    _rule(grid)
    _lay_out(grid, widths_cm(table, WIDTH_CM), bool(table.notes))
    _describe(grid, table)
    if table.notes:
        _add_note(document, _sayable(table.note))
    document.add_paragraph()


def _rule(grid: "Grid") -> None:
    """Rules above and below the head and below the last row, and none between columns."""
    from docx.oxml import OxmlElement
    from docx.oxml.ns import qn

    def border(parent: "BaseOxmlElement", side: str, eighths: str) -> None:
        values = {"val": "single", "sz": eighths, "space": "0", "color": "000000"}
        _append(parent, f"w:{side}", "", **values)

    around = OxmlElement("w:tblBorders")
    border(around, "top", "8")
    border(around, "bottom", "8")
    margins = OxmlElement("w:tblCellMar")
    for side in ("left", "right"):
        _append(margins, f"w:{side}", "", w="70", type="dxa")
    look = grid._tbl.tblPr.find(qn("w:tblLook"))
    look.addprevious(around)
    look.addprevious(margins)
    for cell in grid.rows[0].cells:
        below = OxmlElement("w:tcBorders")
        border(below, "bottom", "4")
        cell._tc.get_or_add_tcPr().append(below)


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


def _fill(cell: "_Cell", split: list[tuple[str, bool]], style: str, right: bool) -> None:
    from docx.enum.text import WD_ALIGN_PARAGRAPH

    paragraph = cell.paragraphs[0]
    # By its id: python-docx looks through all styles for each name, a tenth of a second per report.
    paragraph._p.style = style
    _add_runs(paragraph, split)
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
