"""The Methods paragraph: sentences whose every number names its source; plain text, LaTeX, HTML.

A sentence is a template with {name} for a number, {name:was|were} for the word that goes with one and with
several, and words for what was declared.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from html import escape

from server.methods.repository import Number

_HOLE = re.compile(r"\{(\w+)\}")
_AGREEING = re.compile(r"\{(\w+):([^|{}]*)\|([^|{}]*)\}")
LATEX_SIGNS = {
    "\\": r"\textbackslash{}",
    **{sign: "\\" + sign for sign in "&%$#_{}"},
    "~": r"\textasciitilde{}",
}


@dataclass(frozen=True)
class Methods:
    """Sentences with holes, and the numbers that fill them."""

    study: str
    origin: str
    series: int
    sentences: tuple[str, ...]
    numbers: Mapping[str, Number]

    def text(self) -> str:
        """The paragraph; below it every number with its source, marked as in the paragraph."""
        order = self._order()
        paragraph = " ".join(self._filled(sentence, order, "{value} [{mark}]") for sentence in self.sentences)
        sources = [f"[{mark}] {name}: {self.numbers[name].source}" for name, mark in order.items()]
        return "\n".join([paragraph, "", *sources]) + "\n"

    def plain(self) -> str:
        """The paragraph alone."""
        return " ".join(self._filled(sentence, {}, "{value}") for sentence in self.sentences)

    def latex(self) -> str:
        """The paragraph as LaTeX, each sentence followed by comments that name the sources."""
        lines = [f"% Methods of {self.study}: origin {self.origin}, data series {self.series}"]
        for sentence in self.sentences:
            lines.append(_escaped(self._filled(sentence, {}, "{value}")))
            for name in dict.fromkeys(_HOLE.findall(sentence)):
                number = self.numbers[name]
                lines.append(f"% {name} = {number.value}: {number.source}")
        return "\n".join(lines) + "\n"

    def html(self) -> str:
        """The paragraph, each number a link to its source in the list below it."""
        order = self._order()
        link = '<a href="#methods-{mark}">{value}</a>'
        paragraph = " ".join(self._filled(escape(sentence), order, link) for sentence in self.sentences)
        sources = "\n".join(
            f'<li id="methods-{mark}">{escape(name)}: <code>{escape(self.numbers[name].source)}</code></li>'
            for name, mark in order.items()
        )
        return (
            f'<h2 id="methods-paragraph">Methods paragraph</h2>\n<p>{paragraph}</p>\n'
            f"<details><summary>Where each number comes from</summary>\n<ol>\n{sources}\n</ol>\n</details>\n"
        )

    def json(self) -> str:
        """Paragraph and numbers for programs."""
        content = {
            "study": self.study,
            "origin": self.origin,
            "series": self.series,
            "paragraph": self.plain(),
        }
        listed = [asdict(number) for number in self.numbers.values()]
        return json.dumps(content | {"numbers": listed}, indent=1, ensure_ascii=False) + "\n"

    def _order(self) -> dict[str, int]:
        names = dict.fromkeys(name for sentence in self.sentences for name in _HOLE.findall(sentence))
        return {name: mark for mark, name in enumerate(names, start=1)}

    def _filled(self, sentence: str, order: Mapping[str, int], form: str) -> str:
        def number(hole: re.Match[str]) -> str:
            name = hole[1]
            return form.format(value=self.numbers[name].value, mark=order.get(name, 0))

        def agreeing(word: re.Match[str]) -> str:
            return word[2] if self.numbers[word[1]].value == 1 else word[3]

        return _HOLE.sub(number, _AGREEING.sub(agreeing, sentence))


def _escaped(text: str) -> str:
    return "".join(LATEX_SIGNS.get(sign, sign) for sign in text)
