"""Plain English: banned words with the better one, long sentences, and how hard pages are to read.

    python -m tools.check_language              every finding in docs, texts and code; fails if any: banned
                                                words, errors with long sentences, British comments
    python -m tools.check_language --pages      the site's pages, README, CONTRIBUTING and CHANGELOG:
                                                words, American spelling, reading grades and links
                                                (`make check-docs`)
    python -m tools.check_language --grades     reading grade (Flesch-Kincaid) of each page, hardest first

Code (backticks, code blocks) and quotations are left alone.
"""

from __future__ import annotations

import ast
import re
import statistics
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORDS_IN_ERROR = 25
"""Words in a sentence of an error, at most; a value put in counts as one."""
MEDIAN_GRADE, HIGHEST_GRADE = 10.0, 14.0
"""Reading grades of pages with text: the median, and the hardest page."""
REFERENCE = ("docs/reference/columns.md", "docs/reference/settings.md", "docs/reference/experiment.md")
"""Tables written from the code: their grade says nothing."""
_EACH = (
    r"an? (?:declared )?(?:answer|bar|block|cell|character|clip|column|comparison|condition|effect|eye|"
    r"factor|file|frame|group|inch|item|key|kind|level|line|mm|option|page|pair|participant|person|pixel|play|point|"
    r"question|rater|rating|reason|recording|request|row|rule|run|scale|series|session|statement|study|table|"
    r"text|trial|video|visit|worker)"
)
_COUNTED = (
    "bit|byte|check|clip|column|curve|digit|effect|field|file|intercept|key|letter|line|log|module|note|number|"
    "object|panel|paragraph|picture|pixel|point|profile|rating|record|row|sample|section|sentence|statement|"
    "table|value|variance|view"
)
_SENTENCE_GOES_ON = r"(?=\s*(?:[^\w\s'’]|$)|\s+(?:and|as|at|for|from|in|of|on|that|where|with)\b)"
PER_EACH = (
    rf"\b(?:an?|one|two|three|four|ten|\d+) (?:[\w-]+ )?(?:{_COUNTED})s? {_EACH}\b{_SENTENCE_GOES_ON}|"
    rf"(?<!makes )(?<!call )\bone {_EACH}\b(?=\s*(?:[^\w\s,'’]|$))|"
    rf"\b(?:px|pixels|bytes|bits) {_EACH}\b|\b(?:a|one) (?:row|column) an? (?!separate|few|time)"
)
"""`a value an eye` for `one value per eye`; but `the value an eye reaches` is right: a verb follows."""
BANNED = {
    r"\btold\b|\btells?\b(?! (?:people|apart))": "reported, shown, detected, identified",
    r"\banew\b": "again",
    r"\breckon(?:s|ed|ing)?\b": "compute, count",
    r"\bmend(?:s|ed|ing)?\b": "fix, correct",
    r"\bparted by\b": "separated by",
    r"\bbeside(?!s)\b": "next to, in addition to, with",
    r"(?<!\ba )\bstands?\b(?! (?:for|still|up|out|alone|apart|guard)|-ins?\b)": "is, are",
    r"\bwhoever\b": "anyone who, people who",
    PER_EACH: "one ... per ...",
    r"(?<!there )\b(?:is|are) no (?!longer|one\b|doubt|more|such)": "is not a ...",
    r"\bby its name\b": "by name",
    r"\bof (?:its|their|his|her|one's) own\b": "separate, its own ...",
    r"\bwhat is asked\b": "required",
    r"\band (?:said|says) so\b": "and reports it",
    r"\bthereof\b": "of it",
    r"\bhindmost\b|\bthe likes? of\b": "plain words",
}
BRITISH = {
    r"\b\w*colour\w*": "color",
    r"\b\w*(?:behavi|neighb|fav|hon|lab|hum|rum|vap)our\w*": "or instead of our",
    r"\b\w*label(?:l(?:ed|ing|er))\w*": "labeled, labeling",
    r"\b(?:model|travel|cancel|signal|channel)l(?:ed|ing|er)\w*": "one l",
    r"\banaly(?:se|sed|sing)\b": "analyze",
    r"\b(?:milli|kilo|centi)?metres?\b|\bcentre\w*|\bfibres?\b": "er instead of re",
    r"\bgrey\w*": "gray",
    r"\blicences?\b|\bdefences?\b": "license, defense",
    r"\bjudgements?\b": "judgment",
    r"\bcatalogues?\b|\bprogrammes?\b": "catalog, program",
    r"\b(?:re|de|un|pseud)?(?:random|normal|recogn|organ|summar|item|synthes|local|optim|minim|maxim|general|standard|visual|"
    r"character|initial|util|real|serial|anonym|onym|quant|vector|regular|penal|categor|emphas|apolog|author|custom|"
    r"synchron|symbol)is(?:e|ed|es|ing|ation|ations)\b": "ize, ization",
}
"""British spellings and the American ones."""
UNCHANGED = (
    "migrations/versions",
    "frontend/src/api",
    "stimuli_builder/characters/cartoon",
    "tests/docs/test_language.py",
)
"""Sources that stay byte-identical (the cartoon's are hashed into clips), are generated or test this lint."""
BANNED_WORDS = tuple((re.compile(pattern, re.IGNORECASE), better) for pattern, better in BANNED.items())
BRITISH_WORDS = tuple((re.compile(pattern, re.IGNORECASE), better) for pattern, better in BRITISH.items())
CODE_BLOCK = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
CODE = re.compile(
    r"`[^`\n]*`|\"[^\"\n]*\"|“[^”\n]*”|\]\([^)]*\)|^\[[^\]]+\]: .*"
    r"|--[a-z][a-z-]*|^ *[a-z_]+(?:, [a-z_]+)* : |\banew: true\b|button besid[e]\b"
)
"""Code, quotations, addresses, options, names of parameters in docstrings, a key of the API, a CSS class."""


@dataclass(frozen=True)
class Finding:
    """A banned word and where it is."""

    file: str
    line: int
    word: str
    better: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: '{self.word}': better {self.better}"


def banned_words_in(
    text: str, words: tuple[tuple[re.Pattern[str], str], ...] = BANNED_WORDS
) -> Iterator[tuple[int, str, str]]:
    """Line, word and better word of each banned word outside code and quotations."""
    for number, line in enumerate(text.splitlines(), start=1):
        plain = CODE.sub(" ", line)
        for pattern, better in words:
            for match in pattern.finditer(plain):
                yield number, match.group(0).strip(), better


def prose_of(page: str) -> str:
    """A Markdown page without code, tables, pictures, links and headings."""
    text = CODE_BLOCK.sub("", page)
    text = re.sub(r"^(?:\||#|:::|!\[|\[).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`([^`]*)`", r"code", text)
    # Items of a list are sentences, whether or not they end in a full stop.
    text = re.sub(r"^(\s*(?:-|\d+\.) .*[^.:;!?\s])\s*$", r"\1.", text, flags=re.MULTILINE)
    return re.sub(r"[*_>]|^\s*(?:-|\d+\.) ", "", text, flags=re.MULTILINE)


def pages() -> list[Path]:
    """The pages of the site that people write."""
    written = [
        *(ROOT / "docs").rglob("*.md"),
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        ROOT / "CHANGELOG.md",
    ]
    return sorted(page for page in written if "generated" not in page.parts)


def without_code_blocks(text: str) -> str:
    """The page with its code blocks blanked, so that lines keep their numbers."""
    return CODE_BLOCK.sub(lambda block: "\n" * block.group(0).count("\n"), text)


def grade_of(page: Path) -> float | None:
    """The Flesch-Kincaid grade of a page; None where it has too little text."""
    from textstat import textstat  # type: ignore[import-untyped]  # takes half a second to import

    prose = prose_of(page.read_text(encoding="utf-8"))
    return textstat.flesch_kincaid_grade(prose) if len(prose.split()) >= 60 else None


def source_texts(file: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every string, docstring and comment of a Python module."""
    source = file.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value
    for number, line in enumerate(source.splitlines(), start=1):
        if line.lstrip().startswith("#"):
            yield number, line


def raised_text(node: ast.expr) -> str:
    """A text as raised, with `X` for each value; empty for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(raised_text(part) if isinstance(part, ast.Constant) else "X" for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return raised_text(node.left) + raised_text(node.right)
    return ""


def long_sentences_in(source: str) -> Iterator[tuple[int, str]]:
    """Line and sentence of each error whose sentence has too many words."""
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)):
            continue
        for text in map(raised_text, node.exc.args):
            for sentence in re.split(r"[.?!]\s", text):
                if len(sentence.split()) > WORDS_IN_ERROR:
                    yield node.lineno, sentence


def anchors_of(page: Path) -> set[str]:
    """The names by which links reach the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", without_code_blocks(page.read_text(encoding="utf-8")), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower()) for heading in headings)
    return {heading.strip().replace(" ", "-") for heading in plain}


def broken_links(page: Path) -> list[str]:
    """Links of a page to files or headings that do not exist, but for pages of the build; a line each."""
    faults = []
    text = without_code_blocks(page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", text)):
        name, _, anchor = target.partition("#")
        if re.match(r"[a-z]+:", target) or "generated/" in target:
            continue
        file = (page.parent / name).resolve() if name else page
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors_of(file)):
            faults.append(f"{page.name}: the link {target} leads nowhere: correct it")
    return faults


def findings_in_pages() -> Iterator[Finding]:
    """Every banned word in the pages, and every British spelling in those that people write."""
    for page in pages():
        name = str(page.relative_to(ROOT))
        words = BANNED_WORDS if name in REFERENCE else BANNED_WORDS + BRITISH_WORDS
        text = without_code_blocks(page.read_text(encoding="utf-8"))
        for line, word, better in banned_words_in(text, words):
            yield Finding(name, line, word, better)


def findings_in_code() -> Iterator[Finding]:
    """Every banned word in Python and TypeScript of the programs."""
    listed = subprocess.run(
        ["git", "ls-files", "*.py", "*.ts", "*.tsx"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for name in listed.stdout.splitlines():
        file = ROOT / name
        if not file.is_file() or name.startswith(UNCHANGED):
            continue
        source = file.read_text(encoding="utf-8")
        # Quotes and templates of TypeScript hold texts that people read: they are checked like comments.
        texts = source_texts(file) if name.endswith(".py") else [(1, re.sub('["`]', "'", source))]
        for first, text in texts:
            words = BANNED_WORDS + BRITISH_WORDS if text.lstrip().startswith("# ") else BANNED_WORDS
            for line, word, better in banned_words_in(text, words):
                yield Finding(name, first + line - 1, word, better)
        if name.endswith(".py") and not name.startswith("tests/"):
            for line, sentence in long_sentences_in(source):
                yield Finding(
                    name, line, sentence, f"at most {WORDS_IN_ERROR} words in a sentence of an error"
                )


def grades() -> list[tuple[float, str]]:
    """Grade and name of each page with enough text, hardest first."""
    graded = ((grade_of(page), str(page.relative_to(ROOT))) for page in pages())
    return sorted(((grade, name) for grade, name in graded if grade is not None), reverse=True)


def faults_of_grades(graded: list[tuple[float, str]]) -> list[str]:
    """Pages above the highest grade, and a median above the highest median; a line each."""
    faults = [
        f"{name}: reading grade {grade:.1f}, at most {HIGHEST_GRADE:g}: write shorter sentences"
        for grade, name in graded
        if grade > HIGHEST_GRADE and name not in REFERENCE
    ]
    median = statistics.median(grade for grade, _ in graded)
    if median > MEDIAN_GRADE:
        faults.append(f"reading grade of the pages: median {median:.1f}, at most {MEDIAN_GRADE:g}")
    return faults


def main() -> int:
    """Print the findings or the grades."""
    if "--grades" in sys.argv:
        graded = grades()
        for grade, name in graded:
            print(f"{grade:5.1f}  {name}")
        print(f"{statistics.median(grade for grade, _ in graded):5.1f}  median of {len(graded)} pages")
        return 0
    if "--pages" in sys.argv:
        # Generated tables repeat texts of the code, where `findings_in_code` finds them.
        lines = [str(finding) for finding in findings_in_pages() if finding.file not in REFERENCE]
        lines += faults_of_grades(grades())
        lines += [fault for page in pages() for fault in broken_links(page)]
    else:
        lines = [str(finding) for finding in (*findings_in_pages(), *findings_in_code())]
    print("\n".join(lines) or "language: no banned words")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
