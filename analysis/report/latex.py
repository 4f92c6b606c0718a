"""Tables for LaTeX, and the report as a whole document that pdfLaTeX, XeLaTeX and LuaLaTeX set."""

import re

from analysis.report.contents import Contents, DrawnPart, Picture, Section
from analysis.report.formats import Table, text_share
from analysis.report.numbers import heading_pieces, pieces, signed_cell, with_minus

NEEDS = r"\usepackage{array,booktabs,graphicx,longtable}"
"""What a document must load for the tables."""

LONG = 36
"""A table of more rows is broken over pages."""
WIDE = 40
"""A first cell of more characters is wrapped."""

_MATH = {
    **{"<": "<", ">": ">", "×": r"\times", "±": r"\pm", "−": "-", "√": r"\surd", "≤": r"\le", "≥": r"\ge"},
    **{"≈": r"\approx", "≠": r"\ne", "∞": r"\infty", "→": r"\rightarrow", "←": r"\leftarrow", "·": r"\cdot"},
    **{"²": "^2", "³": "^3", "¹": "^1", "ₚ": "_p", "₀": "_0", "₁": "_1", "₂": "_2", "Δ": r"\Delta"},
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
\usepackage{float}
NEEDS
\setlength{\parindent}{0pt}
\setlength{\parskip}{.5\baselineskip}
\emergencystretch=3em
"""


def latex_text(text: str) -> str:
    """`text` with every character escaped that LaTeX gives a meaning.

    White space of any length is one space: an empty line ends a paragraph, which no caption may hold.
    """
    in_one_line = _CONTROL.sub("\N{REPLACEMENT CHARACTER}", re.sub(r"[ \t\n]+", " ", text))
    return "".join(_LATEX.get(character, character) for character in in_one_line)


def as_latex(table: Table, position: str = "") -> str:
    """A table by booktabs with caption, label and notes; a long one is broken over pages.

    `position` is the option of a floating table: `[H]` keeps it in place.
    """
    caption = f"\\caption{{{latex_text(table.title)}}}\\label{{tab:{table.key}}}"
    heads = " & ".join(_in_italics(head) for head in heading_pieces(table.header))
    header = f"\\toprule\n{heads} \\\\\n\\midrule\n"
    rows = "\n".join(_row(row, table.text_columns) for row in table.rows)
    columns = _columns(table)
    notes = "".join(f"\\par\\smallskip{{\\footnotesize {_sentence(note)}\\par}}\n" for note in table.notes)
    if len(table.rows) > LONG:
        return (
            f"{{\\footnotesize\\setlength{{\\tabcolsep}}{{4pt}}\n\\begin{{longtable}}{{{columns}}}\n"
            f"{caption}\\\\\n{header}\\endfirsthead\n{header}\\endhead\n\\bottomrule\n\\endfoot\n{rows}\n"
            f"\\end{{longtable}}}}\n{notes}"
        )
    # a table wider than the text is made as narrow as it, others stay as they are
    fitted = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
    return (
        f"\\begin{{table}}{position}\n\\centering\\small\n{caption}\n{fitted}\n\\begin{{tabular}}{{{columns}}}\n"
        f"{header}{rows}\n\\bottomrule\n\\end{{tabular}}}}\n{notes}\\end{{table}}\n"
    )


def _row(cells: tuple[str, ...], text_columns: int) -> str:
    """A row, with a minus sign before numbers alone: ids and labels keep their hyphens."""
    signs = (signed_cell(cell, position >= text_columns) for position, cell in enumerate(cells))
    return " & ".join(map(latex_text, signs)) + r" \\"


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
    body += [
        r"\section{Method}",
        latex_text(with_minus(contents.methods)),
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
    items = "\n".join(rf"\item {_sentence(line)}" for line in lines)
    return [rf"\section{{{latex_text(title)}}}", f"\\begin{{itemize}}\n{items}\n\\end{{itemize}}"]


def _sentence(text: str) -> str:
    return _in_italics(pieces(with_minus(text)))


def _in_italics(split: list[tuple[str, bool]]) -> str:
    return "".join(
        rf"\textit{{{latex_text(piece)}}}" if is_symbol else latex_text(piece) for piece, is_symbol in split
    )


def _part(part: DrawnPart, synthetic: bool) -> list[str]:
    heading = "subsection" if part.title else "section"
    made = [rf"\section{{{latex_text(part.title)}}}"] if part.title else []
    made += [rf"\{heading}{{Results}}", _pointer(part), as_latex(part.first, "[H]")]
    made += [_figure(picture, synthetic) for picture in part.pictures]
    in_sentences = _lines("In sentences", part.sentences)
    made += [rf"\{heading}{{In sentences}}", *in_sentences[1:], latex_text(part.self_check)]
    if part.tables:
        made += [rf"\{heading}{{Every test}}", *(as_latex(table, "[H]") for table in part.tables)]
    for section in part.sections:
        made += _section(section, heading, synthetic)
    return made


def _pointer(part: DrawnPart) -> str:
    """Which table and figures answer the question."""
    said = rf"See Table~\ref{{tab:{part.first.key}}}"
    figures = [rf"\ref{{fig:{picture.key}}}" for picture in part.pictures]
    if figures:
        said += f" and {'Figure' if len(figures) == 1 else 'Figures'}~{', '.join(figures)}"
    return f"{said}."


def _section(section: Section, heading: str, synthetic: bool) -> list[str]:
    return [
        rf"\{heading}{{{latex_text(section.title)}}}",
        _sentence(section.text),
        *(_figure(picture, synthetic) for picture in section.pictures),
        *(as_latex(table, "[H]") for table in section.tables),
    ]


def _figure(picture: Picture, synthetic: bool) -> str:
    caption = latex_text(picture.caption) + (" (synthetic data)" if synthetic else "")
    return (
        "\\begin{figure}[H]\n\\centering\n"
        f"\\includegraphics[width=.95\\linewidth]{{{picture.key}.png}}\n"
        f"\\caption{{{caption}}}\\label{{fig:{picture.key}}}\n\\end{{figure}}\n"
    )
