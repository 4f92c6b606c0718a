"""Tables for LaTeX, and the report as a whole document that pdfLaTeX, XeLaTeX and LuaLaTeX set."""

import re
from collections.abc import Sequence

from analysis.report.contents import Contents, DrawnPart, Mention, Picture, Section, cited_works, mentions
from analysis.report.formats import Table, as_sentence, text_share
from analysis.report.numbers import (
    cell_pieces,
    heading_pieces,
    note_pieces,
    pieces,
    unbroken,
    with_minus,
)

NEEDS = r"\usepackage{array,booktabs,graphicx,longtable}"
"""What a document must load for the tables."""

LONG = 36
"""A table of more rows is broken over pages."""
FLOATS = "[!htbp]"
BARRIER = "\\ifdefined\\FloatBarrier\\FloatBarrier\\fi\n"
"""Before a long table, which does not float: others would come after it."""
WIDE = 40
"""A first cell of more characters is wrapped."""

_MATH = {
    **{"<": "<", ">": ">", "×": r"\times", "±": r"\pm", "−": "-", "√": r"\surd", "≤": r"\le", "≥": r"\ge"},
    **{"≈": r"\approx", "≠": r"\ne", "∞": r"\infty", "→": r"\rightarrow", "←": r"\leftarrow", "·": r"\cdot"},
    **{"²": "^2", "³": "^3", "¹": "^1", "⁰": "^0", "⁴": "^4", "⁵": "^5", "⁶": "^6", "⁷": "^7", "⁸": "^8"},
    **{"⁹": "^9", "ₚ": "_p", "₀": "_0", "₁": "_1", "₂": "_2", "Δ": r"\Delta"},
    **{"Λ": r"\Lambda", "Φ": r"\Phi", "Σ": r"\Sigma", "Ω": r"\Omega", "α": r"\alpha", "β": r"\beta"},
    **{"γ": r"\gamma", "δ": r"\delta", "ε": r"\varepsilon", "η": r"\eta", "θ": r"\theta", "κ": r"\kappa"},
    **{"λ": r"\lambda", "μ": r"\mu", "µ": r"\mu", "ν": r"\nu", "π": r"\pi", "ρ": r"\rho", "σ": r"\sigma"},
    **{"τ": r"\tau", "φ": r"\varphi", "χ": r"\chi", "ψ": r"\psi", "ω": r"\omega"},
}
_TEXT = {
    **{"\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{"},
    **{"}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", '"': r"\textquotedbl{}"},
    **{"|": r"\textbar{}", "[": "{[}", "*": "{*}", "`": r"\textasciigrave{}"},
    **{"–": "--", "—": "---", "’": "'", "‘": "`", "“": "``", "”": "''", "…": r"\dots{}", "\u00a0": "~"},
}
_LATEX = {**{sign: rf"\ensuremath{{{math}}}" for sign, math in _MATH.items()}, **_TEXT}
_CONTROL = re.compile("[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\ud800-\\udfff\\ufeff\\ufffe\\uffff]")

_PREAMBLE = r"""% Set it with pdflatex, xelatex or lualatex, in the folder of the report.
\documentclass[11pt,a4paper]{article}
\usepackage{iftex}
\ifPDFTeX
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\IfFileExists{lmodern.sty}{\usepackage{lmodern}}{}
DECLARED\else
ACTIVE\fi
\usepackage[margin=2.3cm]{geometry}
NEEDS
% captions as APA style has them: the number in bold, the title below it in italics
\usepackage{caption}
\captionsetup{labelfont=bf,textfont=it,labelsep=newline,justification=raggedright,singlelinecheck=false}
\captionsetup{font=normalsize,skip=4pt,position=top}
% tables and figures stay in their order, also next to tables over several pages
\IfFileExists{placeins.sty}{\usepackage{placeins}}{\newcommand{\FloatBarrier}{\clearpage}}
\renewcommand{\topfraction}{.9}\renewcommand{\bottomfraction}{.9}
\renewcommand{\textfraction}{.05}\renewcommand{\floatpagefraction}{.7}
\setcounter{topnumber}{4}\setcounter{bottomnumber}{4}\setcounter{totalnumber}{8}
\setcounter{secnumdepth}{0}
\setlength{\LTleft}{0pt}\setlength{\LTright}{\fill}\AtBeginDocument{\setlength{\LTcapwidth}{\textwidth}}
\setlength{\parindent}{0pt}
\setlength{\parskip}{.5\baselineskip}
\emergencystretch=8em\hbadness=10000
"""


def latex_text(text: str) -> str:
    """`text` with every character escaped that LaTeX gives a meaning.

    White space of any length is one space: an empty line ends a paragraph, which no caption may hold.
    """
    in_one_line = _CONTROL.sub("\N{REPLACEMENT CHARACTER}", re.sub(r"[ \t\n]+", " ", text))
    made = "".join(_LATEX.get(character, character) for character in in_one_line)
    # below one another, as in the partial η²
    return made.replace(r"\ensuremath{_p}\ensuremath{^2}", r"\ensuremath{_p^2}")


def as_latex(table: Table, position: str = "") -> str:
    """A table by booktabs with caption, label and notes; a long one is broken over pages.

    `position` is the option of a floating table.
    """
    caption = f"\\caption{{{latex_text(table.title)}}}\\label{{tab:{table.key}}}"
    heads = " & ".join(_in_italics(head) for head in heading_pieces(table.header))
    header = f"\\toprule\n{heads} \\\\\n\\midrule\n"
    rows = "\n".join(_row(row, table.text_columns) for row in table.rows)
    columns = _columns(table)
    notes = _note(table.note)
    if len(table.rows) > LONG:
        return (
            f"{BARRIER}{{\\footnotesize\\setlength{{\\tabcolsep}}{{4pt}}\n\\begin{{longtable}}{{{columns}}}\n"
            f"{caption}\\\\\n{header}\\endfirsthead\n{header}\\endhead\n\\bottomrule\n\\endfoot\n{rows}\n"
            f"\\end{{longtable}}}}\n{notes}"
        )
    # a table wider than the text is made as narrow as it, others stay as they are
    fitted = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
    return (
        f"\\begin{{table}}{position}\n\\raggedright\\small\n{caption}\n{fitted}\n\\begin{{tabular}}{{{columns}}}\n"
        f"{header}{rows}\n\\bottomrule\n\\end{{tabular}}}}\n{notes}\\end{{table}}\n"
    )


def _note(text: str) -> str:
    if not text:
        return ""
    return f"\\par\\smallskip{{\\footnotesize\\raggedright \\textit{{Note.}} {_noted(text)}\\par}}\n"


def _row(cells: tuple[str, ...], text_columns: int) -> str:
    """A row, with a minus sign before numbers alone: ids and labels keep their hyphens."""
    made = (cell_pieces(cell, position >= text_columns) for position, cell in enumerate(cells))
    return " & ".join(map(_in_italics, made)) + r" \\"


def _columns(table: Table) -> str:
    kinds = ["l" if i < table.text_columns else "r" for i in range(len(table.header))]
    if max((len(row[0]) for row in table.rows if row), default=0) > WIDE:
        kinds[0] = rf">{{\raggedright\arraybackslash}}p{{{text_share(table):.2f}\linewidth}}"
    return "".join(kinds)


def as_document(contents: Contents, parts: tuple[DrawnPart, ...], version: str) -> str:
    """The whole page as a document, with figures as PNG in the same folder.

    Parameters
    ----------
    contents : Contents
    parts : tuple of DrawnPart
        With their figures drawn.
    version : str
        Of this program, for the last line.

    Returns
    -------
    str
        A .tex file.
    """
    body = [rf"\title{{{latex_text(contents.title)}}}", r"\author{}", r"\date{}", r"\begin{document}"]
    body.append(r"\maketitle")
    if contents.synthetic:
        warned = f"SYNTHETIC DATA. {contents.warning}"
        body.append(rf"\begin{{center}}\fbox{{\parbox{{.9\linewidth}}{{\bfseries {warned}}}}}\end{{center}}")
    body.append(latex_text(f"{contents.lead}, from {contents.source}."))
    for part in parts:
        body += _lines(f"In brief: {part.title}" if part.title else "In brief", part.brief)
    left_out = (*contents.left_out, *contents.decisions) or ("none; every row was analyzed",)
    body += _lines("Exclusions and decisions", left_out)
    for part in parts:
        body += _part(part, contents.synthetic)
    if contents.evidence:
        body += _section(contents.evidence, "section", contents.synthetic)
    body += [r"\FloatBarrier", r"\section{Method}", _noted(contents.methods)]
    if works := cited_works(parts, contents.methods):
        body.append(r"\section{References}")
        body += [rf"\hangindent=1.27cm\hangafter=1 {_reference(work)}" for work in works]
    body += [
        f"Made by palpebra {latex_text(version)}.",
    ]
    text = "\n\n".join([*body, r"\end{document}"]) + "\n"
    preamble = _PREAMBLE.replace("DECLARED", _declared(text)).replace("ACTIVE", _active(text))
    return preamble.replace("NEEDS", NEEDS) + text


def _declared(text: str) -> str:
    """What pdfLaTeX prints for characters that it does not know: their number."""
    further = sorted({character for character in text if not character.isascii()})
    return "".join(
        f"\\ifcsname u8:\\detokenize{{{one}}}\\endcsname\\else\\DeclareUnicodeCharacter{{{ord(one):04X}}}"
        f"{{\\texttt{{U+{ord(one):04X}}}}}\\fi\n"
        for one in further
    )


def _active(text: str) -> str:
    """What XeLaTeX and LuaLaTeX print for characters that their font lacks, which they drop without a word.

    U+FFFD stands for a control character, and LuaTeX takes it for broken UTF-8.
    """
    further = sorted({character for character in text if not character.isascii()} - {"\ufffd"})
    return "".join(
        f'\\catcode`\\{one}=\\active\\protected\\def{one}{{\\iffontchar\\font"{ord(one):04X} '
        f'\\char"{ord(one):04X} \\else\\texttt{{U+{ord(one):04X}}}\\fi}}\n'
        for one in further
    )


def _lines(title: str, lines: tuple[str, ...]) -> list[str]:
    if not lines:
        return []
    items = "\n".join(rf"\item {_sentence(as_sentence(line))}" for line in lines)
    return [rf"\section{{{latex_text(title)}}}", f"\\begin{{itemize}}\n{items}\n\\end{{itemize}}"]


def _sentence(text: str) -> str:
    return _in_italics(pieces(unbroken(with_minus(text))))


def _noted(text: str) -> str:
    return _in_italics(note_pieces(unbroken(with_minus(text))))


def _reference(work: list[tuple[str, bool]]) -> str:
    """A work of the list, in which an address may be broken at its slashes."""
    return _in_italics(work).replace("/", r"/\allowbreak{}")


def _in_italics(split: list[tuple[str, bool]]) -> str:
    return "".join(
        rf"\textit{{{latex_text(piece)}}}" if is_symbol else latex_text(piece) for piece, is_symbol in split
    )


def _part(part: DrawnPart, synthetic: bool) -> list[str]:
    heading = "subsection" if part.title else "section"
    made = [rf"\section{{{latex_text(part.title)}}}"] if part.title else []
    made += [rf"\{heading}{{Results}}", _pointer([part.first], part.pictures), as_latex(part.first, FLOATS)]
    made += [_figure(picture, synthetic) for picture in part.pictures]
    in_sentences = _lines("In sentences", part.sentences)
    made += [rf"\{heading}{{In sentences}}", *in_sentences[1:], _noted(part.self_check)]
    if part.tables:
        made += [rf"\{heading}{{Every test}}", _pointer(part.tables, ())]
        made += [as_latex(table, FLOATS) for table in part.tables]
    for section in part.sections:
        made += _section(section, heading, synthetic)
    return made


def _pointer(tables: Sequence[Table], pictures: Sequence[Picture]) -> str:
    """Which tables and figures hold the results."""
    kinds = {"Table": "tab", "Figure": "fig"}
    return "".join(
        rf"\ref{{{kinds[one.noun]}:{one.key}}}" if isinstance(one, Mention) else latex_text(one)
        for one in mentions(tables, pictures)
    )


def _section(section: Section, heading: str, synthetic: bool) -> list[str]:
    return [
        rf"\{heading}{{{latex_text(section.title)}}}",
        f"{_noted(section.text)} {_pointer(section.tables, section.pictures)}",
        *(_figure(picture, synthetic) for picture in section.pictures),
        *(as_latex(table, FLOATS) for table in section.tables),
    ]


def _figure(picture: Picture, synthetic: bool) -> str:
    caption = latex_text(picture.caption) + (" (synthetic data)" if synthetic else "")
    return (
        f"\\begin{{figure}}{FLOATS}\n\\raggedright\n\\caption{{{caption}}}\\label{{fig:{picture.key}}}\n"
        f"\\includegraphics[width=.95\\linewidth]{{{picture.key}.png}}\n{_note(picture.note)}\\end{{figure}}\n"
    )
