"""The text of a manuscript or report: plain text, Markdown, HTML, TeX, DOCX, or the text layer of a PDF."""

import re
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from experiments.errors import InputError

# What a reader of a DOCX file sees: insertions, formulas, symbols and notes too, each table cell once.

_W = "{http://schemas.openxmlformats.org/wordprocessingml/2006/main}"
_M = "{http://schemas.openxmlformats.org/officeDocument/2006/math}"
_HIDDEN_IN_WORD = frozenset(
    {f"{_W}del", f"{_W}moveFrom", "{http://schemas.openxmlformats.org/markup-compatibility/2006}Fallback"}
)
_SYMBOLS = {0x63: "χ", 0x65: "ε", 0x68: "η", 0x77: "ω", 0x2D: "-", 0xA3: "<", 0xB3: ">", 0xB4: "×"}
"""Characters of Word's font Symbol, by the last byte of their number."""
_NOTES = ("footnotes", "endnotes")


def word_text(document: Any) -> str:
    """The text of a document of python-docx, one paragraph per line, notes last."""
    from docx.oxml import parse_xml

    roots = [document.element.body]
    for related in document.part.rels.values():
        if not related.is_external and related.reltype.rpartition("/")[2] in _NOTES:
            roots.append(parse_xml(related.target_part.blob))
    return "\n".join("".join(_paragraph(one)) for root in roots for one in root.iter(f"{_W}p"))


def _paragraph(element: Any) -> Iterator[str]:
    """The parts of a paragraph; paragraphs within it (of a text box) stand for themselves."""
    for child in element:
        if child.tag in _HIDDEN_IN_WORD or child.tag == f"{_W}p":
            continue
        if child.tag in (f"{_W}t", f"{_M}t"):
            yield child.text or ""
        elif child.tag == f"{_W}sym":
            number = int(child.get(f"{_W}char") or "0", 16)
            yield _SYMBOLS.get(number & 0xFF, " ") if child.get(f"{_W}font") == "Symbol" else " "
        elif child.tag in (f"{_W}tab", f"{_W}br", f"{_W}cr"):
            yield " "
        elif child.tag == f"{_W}noBreakHyphen":
            yield "-"
        else:
            yield from _paragraph(child)


KINDS = (".txt", ".md", ".html", ".htm", ".tex", ".docx", ".pdf")

_DAMAGED = (
    *(BadZipFile, zlib.error, EOFError, OSError, KeyError, ValueError),
    *(AttributeError, TypeError, IndexError, SyntaxError, RecursionError),
)
"""What the packages raise for damaged files besides their own errors; broken XML is a SyntaxError."""
_HIDDEN_IN_HTML = frozenset({"script", "style", "head", "svg", "template"})
_BLOCKS = frozenset({"p", "li", "tr", "td", "th", "div", "h1", "h2", "h3", "h4", "figcaption", "br", "table"})
_TEX_WORDS = {
    r"\eta": "η",
    r"\chi": "χ",
    r"\omega": "ω",
    r"\epsilon": "ε",
    r"\varepsilon": "ε",
    r"\le": "<",
    r"\leq": "<",
    r"\ge": ">",
    r"\geq": ">",
    r"\times": "×",
    r"\pm": "±",
}
_TEX_DF = re.compile(r"(?<![A-Za-z])(F|t|r|\\chi(?:\^\{?2\}?))_(?:\{([\d., ]+)\}|(\d))(?= *\$? *=)")
"""Degrees of freedom as many journals set them: F_{1,20}, t_{28}, \\chi^2_2."""
_SIGNS = str.maketrans(
    {
        **dict.fromkeys("\u00a0\u2009\u202f\u2002\u2003\u2005\u2006\u2007\u200a\t", " "),
        **dict.fromkeys("−‒–—⁻\u2010\u2011", "-"),
        **dict.fromkeys("\u200b\u00ad\ufeff", ""),
        **dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True)),
        "ₚ": "p",
        "≤": "<",
        "≥": ">",
        "𝐹": "F",
        "𝑝": "p",
        "𝑡": "t",
        "𝜂": "η",
        "𝜒": "χ",
    }
)


_BROKEN = re.compile(
    r"(?<=[=<>(\[,]) ?\n *(?=[\w.-])"
    r"| ?\n *(?==)"
    r"|(?<=\b[pP]) ?\n *(?=[<>])|(?<=\b[FtrX]) ?\n *(?=[(\[])|(?<=%) ?\n *(?=CI)|(?<=CI) ?\n *(?=[\[(])"
    r"|(?<=partial) ?\n *(?=η|eta)"
)
"""The end of a line within a statistic: of no paragraph, item or cell."""


def read_document(path: Path) -> str:
    """The text of a file by its suffix, one paragraph, list item or table cell per line.

    Parameters
    ----------
    path : Path
        A file whose suffix is one of `KINDS`.

    Returns
    -------
    str
        Text with plain signs: spaces, minus, superscript and subscript as ordinary characters.

    Raises
    ------
    InputError
        No file, another suffix, a damaged file, or a PDF without a text layer.
    """
    if not path.is_file():
        raise InputError(f"there is no file {path}; expected {', '.join(KINDS)} or a TOML file of figures")
    suffix = path.suffix.lower()
    if suffix == ".docx":
        return plain(_docx(path))
    if suffix == ".pdf":
        return unbroken(plain(_pdf(path)))
    if suffix not in KINDS:
        raise InputError(f"{path.name}: cannot read '{suffix}'; expected {', '.join(KINDS)} or .toml")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as UTF-8") from error
    if suffix in (".html", ".htm"):
        return plain(html_text(text))
    if suffix == ".tex":
        return unbroken(plain(tex_text(text)))
    return unbroken(plain(re.sub(r"[*_`\\]", "", text) if suffix == ".md" else text))


def plain(text: str) -> str:
    """Text with one kind of space and minus, and no raised or lowered signs."""
    return re.sub(r" {2,}", " ", text.translate(_SIGNS))


def unbroken(text: str) -> str:
    """Text whose lines never end within a statistic; for files whose lines are not paragraphs."""
    return _BROKEN.sub(" ", text)


class _Text(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.parts: list[str] = []
        self.hidden = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        del attrs
        self.hidden += tag in _HIDDEN_IN_HTML
        if tag in _BLOCKS:
            self.parts.append("\n")

    def handle_endtag(self, tag: str) -> None:
        self.hidden -= tag in _HIDDEN_IN_HTML and self.hidden > 0
        if tag in _BLOCKS:
            self.parts.append("\n")

    def handle_data(self, data: str) -> None:
        if not self.hidden:
            self.parts.append(re.sub(r"\s+", " ", data))


def html_text(html: str) -> str:
    """What a reader of an HTML page sees, one line per block."""
    parser = _Text()
    parser.feed(html)
    parser.close()
    return "".join(parser.parts)


def tex_text(tex: str) -> str:
    """TeX source without comments, mathematics signs and formatting; names of Greek letters as letters."""
    text = re.sub(r"(?<!\\)%.*", "", tex)
    text = re.sub(r"\\[,;:! ]|~", " ", text)
    text = re.sub(r"\\(?:left|right|[bB]ig+[lr]?)(?![A-Za-z])", "", text)
    text = _TEX_DF.sub(r"\1(\2\3)", text)
    text = re.sub(r"\\([%&#_$])", r"\1", text)
    for word, sign in sorted(_TEX_WORDS.items(), key=lambda item: -len(item[0])):
        text = re.sub(re.escape(word) + r"(?![A-Za-z])", sign, text)
    text = re.sub(r"\\[A-Za-z]+\*?(\[[^\]]*\])?", "", text)
    text = re.sub(r"[{}$]|\\[()\[\]]", "", text)
    return re.sub(r"\\\\|(?<!\S)&(?!\S)", "\n", re.sub(r"[\^_]", "", text))


def _docx(path: Path) -> str:
    # only this kind of file needs the package
    from docx import Document
    from docx.opc.exceptions import OpcError

    try:
        return word_text(Document(str(path)))
    except (OpcError, *_DAMAGED) as error:
        raise InputError(f"{path.name} is not a readable DOCX file: {_line(error)}") from error


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _pdf(path: Path) -> str:
    from pypdf import PdfReader
    from pypdf.errors import PyPdfError

    try:
        text = "\n".join(page.extract_text() for page in PdfReader(path).pages)
    except (PyPdfError, *_DAMAGED) as error:
        raise InputError(f"{path.name} is not a readable PDF file: {_line(error)}") from error
    if not text.strip():
        raise InputError(f"{path.name} has no text layer (a scan?); save it as text first")
    return text
