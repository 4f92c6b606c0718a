"""What a reader of a DOCX file sees: insertions, formulas, symbols and notes too, each table cell once."""

from collections.abc import Iterator
from typing import Any

_W = "{http://schemas.openxmlformats.org/wordprocessingml/2006/main}"
_M = "{http://schemas.openxmlformats.org/officeDocument/2006/math}"
_HIDDEN = frozenset(
    {f"{_W}del", f"{_W}moveFrom", "{http://schemas.openxmlformats.org/markup-compatibility/2006}Fallback"}
)
_SYMBOLS = {0x63: "χ", 0x65: "ε", 0x68: "η", 0x77: "ω", 0x2D: "-", 0xA3: "<", 0xB3: ">", 0xB4: "×"}
"""Of Word's font Symbol, by the last byte of a sign's number."""
_NOTES = ("footnotes", "endnotes")


def word_text(document: Any) -> str:
    """The text of a document of python-docx, one paragraph a line, notes last."""
    from docx.oxml import parse_xml

    roots = [document.element.body]
    for related in document.part.rels.values():
        if not related.is_external and related.reltype.rpartition("/")[2] in _NOTES:
            roots.append(parse_xml(related.target_part.blob))
    return "\n".join("".join(_paragraph(one)) for root in roots for one in root.iter(f"{_W}p"))


def _paragraph(element: Any) -> Iterator[str]:
    """The parts of a paragraph; paragraphs within it (of a text box) stand for themselves."""
    for child in element:
        if child.tag in _HIDDEN or child.tag == f"{_W}p":
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
