"""Letters of names in figures: which of them the figures' own font lacks, and what draws those."""

from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib as mpl
from matplotlib import font_manager
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter

FONT = "DejaVu Sans"
"""Comes with matplotlib: Latin, Greek, Cyrillic, Arabic, hardly any Chinese, Japanese or Korean."""

_NOTE = "Letters for which no font was at hand stand as their numbers (U+...)."


def _charmap(path: str) -> frozenset[int]:
    return frozenset(font_manager.get_font(path).get_charmap())


def lacking(texts: list[str]) -> set[str]:
    """The characters of `texts` that the figures' own font lacks; those that print nothing aside."""
    known = _charmap(font_manager.findfont(FONT))
    characters = set("".join(texts))
    return {one for one in characters if one.isprintable() and not one.isspace() and ord(one) not in known}


def _further_fonts(letters: set[str]) -> tuple[list[str], set[str]]:
    """Families installed here that have the letters, in the order of their names, and what is left."""
    families: list[str] = []
    left = set(letters)
    installed = font_manager.fontManager.ttflist
    regular = [font for font in installed if font.style == "normal" and font.weight in (400, "normal")]
    for font in sorted(regular, key=lambda one: ("CJK" not in one.name, "Sans" not in one.name, one.name)):
        if not left:
            break
        codes = _charmap(font.fname)
        drawn = {letter for letter in left if ord(letter) in codes}
        if drawn and "LastResort" not in font.name.replace(" ", ""):
            families.append(font.name)
            left -= drawn
    return families, left


def _as_numbers(text: str, left: set[str]) -> str:
    return "".join(f"[U+{ord(one):04X}]" if one in left else one for one in text)


def _add_to_note(figure: Figure) -> None:
    note = figure.get_supxlabel()
    if not note:
        figure.supxlabel(_NOTE, fontsize=7)
    for text in figure.texts:
        if note and text.get_text() == note:
            text.set_text(f"{note}\n{_NOTE}")


@contextmanager
def further_letters(figure: Figure) -> Iterator[None]:
    """Within it the figure is drawn with fonts of this machine for the letters that its own font lacks.

    A letter that no font here has stands as its number, and the figure's note says so: two levels of
    boxes could not be told apart. A figure whose letters its own font has is drawn as it is, whatever
    is installed.
    """
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text)]
    letters = lacking([text.get_text() for text in texts])
    if not letters:
        yield
        return
    families, left = _further_fonts(letters)
    if left:
        _add_to_note(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            labels = [_as_numbers(label.get_text(), left) for label in axis.get_ticklabels()]
            if any(labels) and isinstance(axis.get_major_formatter(), FuncFormatter | FixedFormatter):
                axis.set_ticks(axis.get_majorticklocs(), labels=labels)
    for text in figure.findobj(Text):
        if isinstance(text, Text):
            text.set_text(_as_numbers(text.get_text(), left))
            text.set_fontfamily([FONT, *families])
    with mpl.rc_context({"font.family": [FONT, *families]}):
        yield
