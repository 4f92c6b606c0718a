"""Statistics reported in running text: found, recomputed from their own numbers, or not readable."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from itertools import product, zip_longest
from typing import Literal

import numpy as np
from scipy import special

from analysis.paper.printed import PrintedInterval
from analysis.report.numbers import share
from analysis.within.strata import partial_eta_squared_ci

# How far behind a statistic its own p and effect size may be: up to where another clause begins.

_END_OF_SENTENCE = re.compile(r"[.!?][\"')\]]*\s+(?=[A-Z])")
_CONTRAST = re.compile(r"\b(?:whereas|while|although|though|but|however|nor|and the|or the)\b", re.IGNORECASE)
_PARTS = re.compile(r";|[^\W\d_]{2,}(?:['’-][^\W\d_]+)*")
_OF_REPORTS = re.compile(
    r"partial|generali[sz]ed|eta|omega|epsilon|squared|cohen\S*|hedges\S*|glass\S*|delta|phi|cramer\S*|effect|size"
    r"|mse|se|sd|sem|ci|cis|confidence|credible|interval|power|observed|bayes|factor|bf|aic|bic"
    r"|corrected|uncorrected|adjusted|correction|greenhouse\S*|geisser|huynh\S*|feldt|bonferroni\S*|holm\S*"
    r"|sidak|tukey\S*|wilks\S*|lambda|pillai\S*|trace|hotelling\S*|roy\S*|one|two|tailed|sided|exact|asymptotic"
    r"|with|all|significant|at|ns|non|not|and|yielded|giving|its|of|an?|level|one-tailed|two-tailed|one-sided"
    r"|two-sided|monte|carlo|permutation|associated|corresponding|value|values|df|max|min|both|ps",
    re.IGNORECASE,
)
WORDS_MAX = 2
"""Maximum number of words that reports of statistics do not have between a statistic and its p."""


def own_clause(tail: str) -> str:
    """The beginning of `tail`, the text behind a statistic, that can hold its own p and effect size.

    Another clause begins with a sentence, a contrast, the first word behind a semicolon that no report of a
    statistic has, or with more than `WORDS_MAX` such words elsewhere: what follows is of something else.
    """
    ends = [match.start() for pattern in (_END_OF_SENTENCE, _CONTRAST) if (match := pattern.search(tail))]
    tail = tail[: min(ends, default=len(tail))]
    semicolon, strange = -1, 0
    for part in _PARTS.finditer(tail):
        if part[0] == ";":
            semicolon = part.start()
        elif not _OF_REPORTS.fullmatch(part[0]):
            strange += 1
            if semicolon >= 0 or strange > WORDS_MAX:
                return tail[: semicolon if semicolon >= 0 else part.start()]
    return tail


# The p values that a printed statistic and its df allow.

Kind = Literal["F", "t", "chi2", "r", "z"]


def corners(printed: str, whole_is_exact: bool = False) -> tuple[float, ...]:
    """The ends of what rounds to a printed number."""
    if whole_is_exact and "." not in printed:
        return (float(printed),)
    rounded = PrintedInterval.of(printed)
    return float(rounded.low), float(rounded.high)


def p_range(kind: Kind, df: tuple[str, ...], value: str) -> tuple[float, float]:
    """Smallest and largest p that a printed statistic allows, two-sided for t, r and z."""
    low, high = corners(value.lstrip("-"))
    values = [max(low, 0.0), high]  # 0.00 can have been anything from 0 on
    degrees = product(*(corners(d, whole_is_exact=True) for d in df))
    p = [_p(kind, at, v) for at in degrees for v in values]
    return min(p), max(p)


def _p(kind: Kind, df: tuple[float, ...], value: float) -> float:
    if min(df, default=1.0) <= 0:
        return float("nan")
    if kind == "F":
        return float(special.fdtrc(df[0], df[1], value))
    if kind == "t":
        return float(2 * special.stdtr(df[0], -value))
    if kind == "chi2":
        return float(special.chdtrc(df[0], value))
    if kind == "r":
        # An r of 1 would divide by zero.
        r = min(value, 1 - 1e-12)
        return float(2 * special.stdtr(df[0], -r * np.sqrt(df[0] / (1 - r * r))))
    return float(2 * special.ndtr(-value))


Verdict = Literal["consistent", "inconsistent", "decision", "unchecked"]

KINDS: tuple[Kind, ...] = ("F", "t", "chi2", "r", "z")

_NUMBER = r"-?(?:\d+(?:\.\d+)?|\.\d+)"
_WHOLE = r"(?![\d.]*\d|,\d)"
"""Not a part of a longer number: of one with a decimal comma the whole part would be read for all of it."""
_STATISTIC = re.compile(
    rf"(?<![A-Za-z])(?:"
    rf"(?P<F>F)[12]? ?[(\[] ?(?P<f1>{_NUMBER}) ?[,;/] ?(?P<f2>{_NUMBER}) ?[)\]]"
    rf"|(?P<t>t) ?[(\[] ?(?P<t1>{_NUMBER}) ?[)\]]"
    rf"|(?P<chi2>(?:χ|chi)[- ]?2|chi[- ]squared?|X2) ?[(\[] ?(?P<c1>{_NUMBER})"
    rf"(?: ?[,;] ?N ?= ?[\d,]+)? ?[)\]]"
    rf"|(?P<r>r) ?[(\[] ?(?P<r1>{_NUMBER}) ?[)\]]"
    rf"|(?P<z>[zZ])(?= ?= ?-?[\d.])"
    rf") ?= ?(?P<value>{_NUMBER}){_WHOLE}"
)
_METHODS = (
    r"(?:Bonferroni|Holm|Tukey|Kramer|HSD|[SŠsš]id[aá]k|Scheff[eé]|Hochberg|Benjamini|FDR|Dunnett?|Games|"
    r"Newman|Greenhouse|Huynh|bonf|adj|corr|GG|HF)"
)
"""Names of corrections that make a p larger than that of its statistic."""
_P = re.compile(
    rf"(?<![A-Za-z])[pP](?:[_-]?\{{?(?P<label>{_METHODS}[a-z]*)\}}?)? ?(?P<sign>[=<>]) ?(?P<p>{_NUMBER})"
    rf"{_WHOLE}",
    re.IGNORECASE,
)
_SCIENTIFIC = re.compile(
    r"(?<![\w.,])(?:(?P<mantissa>\d+(?:\.\d+)?|\.\d+)"
    r"(?: ?[x×·*] ?10 ?\^? ?(?=-)|[eE](?=[-+]?\d))|10 ?\^ ?(?=-))(?P<exponent>[-+]?\d{1,3})(?!\w)"
)
_THOUSANDS = re.compile(r"(?<![\d.,])\d{1,3}(?:,\d{3})+\.\d+")
_CORRECTION = re.compile(rf"\b(?:(?:un)?corrected|(?:un)?adjusted|correction|{_METHODS})\b", re.IGNORECASE)
_ONE_TAILED = re.compile(r"\b(?:one|1)[-‐‑– ]?(?:tail(?:ed)?|sided?)\b|\bdirectional\b", re.IGNORECASE)
_ALL_ONE_TAILED = re.compile(
    r"\b(?:tests?|comparisons?|hypothes[ei]s|p[- ]?values?)\b[^.;]{0,60}\b(?:were|was|are|is)\b[^.;]{0,30}"
    r"\b(?:one|1)[-‐‑– ]?(?:tailed|sided)",
    re.IGNORECASE,
)
_SENTENCE_END = re.compile(r"[.!?]\s+(?=[A-Z(])|\n\n")
_ETA = re.compile(
    rf"(?P<before>partial |generali[sz]ed )?(?:η|eta)(?P<after> squared|[- ]?2 ?p|[- ]?2| ?p ?2)?"
    rf" ?= ?(?P<eta>{_NUMBER})"
    rf"(?:,? ?(?P<level>\d\d) ?% ?CI:? ?[\[(] ?(?P<low>{_NUMBER}) ?[,;] ?(?P<high>{_NUMBER}) ?[\])])?"
)
_LOOKS_LIKE = re.compile(
    r"(?<![A-Za-z])(?:F ?[(\[] ?\d|t ?[(\[] ?\d|(?:χ|chi) ?-?2 ?[(\[]|[pP] ?[=<>] ?\.?\d)"
)
_LEVEL = re.compile(r"(?:(?<=[*†])|^(?=.{,12}$)) *p ?< ?0?\.0(?:5|1|01)(?!\d)", re.MULTILINE)
"""The head of a column or the legend of a table, which names a level and reports nothing."""

NEAR = 30
"""Characters before and after a p in which it is said to be one-tailed or corrected."""

REACH = 160
"""Characters after a statistic in which its p and its effect size are looked for."""

INTERVAL_TOLERANCE = 0.015
"""How far a printed bound of an effect size may lie from the recomputed one."""


@dataclass(frozen=True)
class ReportedStatistic:
    """One statistic as printed, with what recomputation says.

    `p_range` are the p values that printed statistic and df allow, given their rounding; `problems` say what
    does not fit. `decision`: significant at .05 by one and not by the other.
    """

    text: str
    kind: Kind
    df: tuple[str, ...]
    value: str
    p: str | None
    effect_size: str | None
    p_range: tuple[float, float]
    verdict: Verdict
    problems: tuple[str, ...]


@dataclass(frozen=True)
class TextCheck:
    """The statistics read in a text, and fragments that look like statistics and could not be read."""

    statistics: tuple[ReportedStatistic, ...]
    unread: tuple[str, ...]

    @property
    def n_checked(self) -> int:
        """Statistics with a p or an effect size to compare with."""
        return sum(s.verdict != "unchecked" for s in self.statistics)

    @property
    def n_wrong(self) -> int:
        """Statistics that do not fit their p or effect size."""
        return sum(s.verdict in ("inconsistent", "decision") for s in self.statistics)


def check_text(text: str) -> TextCheck:
    """Read and check every statistic of `text` (plain signs, see `analysis.paper.document.plain`)."""
    text = _plain_numbers(text)
    matches = list(_STATISTIC.finditer(text))
    all_one_tailed = bool(_ALL_ONE_TAILED.search(text))
    statistics, covered = [], []
    for match, following in zip_longest(matches, matches[1:]):
        # Not beyond the next statistic, whose p is another.
        end = min(match.end() + REACH, following.start() if following else len(text))
        tail = own_clause(text[match.end() : end].split("\n\n")[0])
        before = _SENTENCE_END.split(text[max(0, match.start() - REACH) : match.start()])[-1]
        reported, used = _reported(match, tail, before, all_one_tailed)
        statistics.append(reported)
        covered.append((match.start(), match.end() + used))
    covered += [match.span() for match in _LEVEL.finditer(text)]
    unread = [
        " ".join(text[m.start() : m.start() + 60].split())
        for m in _LOOKS_LIKE.finditer(text)
        if not any(start <= m.start() < end for start, end in covered)
    ]
    return TextCheck(tuple(statistics), tuple(unread))


def _plain_numbers(text: str) -> str:
    """Powers of ten as decimals with the same last digit, and numbers with a decimal point without commas."""
    text = _THOUSANDS.sub(lambda match: match[0].replace(",", ""), text)
    return _SCIENTIFIC.sub(
        lambda match: f"{Decimal(match['mantissa'] or '1').scaleb(int(match['exponent'])):f}", text
    )


def _reported(
    match: re.Match[str], tail: str, before: str, all_one_tailed: bool
) -> tuple[ReportedStatistic, int]:
    """One statistic with the clause after it; `before` is its sentence as far as the statistic."""
    kind = next(k for k in KINDS if match[k])
    df = tuple(match[g] for g in ("f1", "f2", "t1", "c1", "r1") if match[g])
    p, eta = _P.search(tail), _ETA.search(tail) if kind == "F" else None
    allowed = p_range(kind, df, match["value"])
    allowed = _best(p, _readings(p, kind, df, allowed, tail, before, all_one_tailed)) if p else allowed
    problems = [
        *(_p_problems(p, allowed) if p else ()),
        *(_eta_problems(df, match["value"], eta) if eta else ()),
    ]
    crosses = bool(p and problems and _crosses(p, allowed))
    verdict: Verdict = "consistent" if p or eta else "unchecked"
    if problems:
        verdict = "decision" if crosses else "inconsistent"
    used = max(p.end() if p else 0, eta.end() if eta else 0)
    text = " ".join((match[0] + tail[:used]).split())
    said = f"{p['sign']} {p['p']}" if p else None
    size = eta["eta"] if eta else None
    reported = ReportedStatistic(
        text,
        kind,
        df,
        match["value"],
        said,
        size,
        allowed,
        verdict,
        tuple(problems),
    )
    return reported, used


def _readings(
    p: re.Match[str],
    kind: Kind,
    df: tuple[str, ...],
    allowed: tuple[float, float],
    tail: str,
    before: str,
    all_one_tailed: bool,
) -> list[tuple[float, float]]:
    """The ranges of p that the words about a statistic allow, the likeliest first.

    A one-sided p is half of the two-sided one, or the rest to 1 where the effect has the other sign; a
    correction makes p larger, by how much the text does not say. Words next to the p decide; those earlier
    in the sentence, or about all tests, may mean another statistic and only add a reading.
    """
    near = tail[max(0, p.start() - NEAR) : p.end() + NEAR]
    one_sample = kind in ("t", "r", "z") or (kind in ("F", "chi2") and float(df[0]) == 1)
    halves = [(allowed[0] / 2, allowed[1] / 2), (1 - allowed[1] / 2, 1 - allowed[0] / 2)]
    ranges = [allowed]
    if one_sample and _ONE_TAILED.search(near):
        ranges = halves
    elif one_sample and (all_one_tailed or _ONE_TAILED.search(before)):
        ranges = [allowed, *halves]
    if p["label"] or _is_corrected(near) or _is_corrected(before):
        return [(low, 1.0) for low, _ in ranges]
    return ranges


def _best(p: re.Match[str], ranges: list[tuple[float, float]]) -> tuple[float, float]:
    """The first range that the printed p fits, else the first."""
    return next((one for one in ranges if not list(_p_problems(p, one))), ranges[0])


def _is_corrected(text: str) -> bool:
    # Uncorrected and unadjusted say the opposite.
    return any(not match[0].lower().startswith("un") for match in _CORRECTION.finditer(text))


def _p_problems(p: re.Match[str], allowed: tuple[float, float]) -> Iterator[str]:
    low, high = allowed
    printed = float(p["p"])
    if printed > 1 or printed < 0:
        yield f"p = {p['p']} is not a probability"
        return
    if p["sign"] == "<":
        fits = low < printed
    elif p["sign"] == ">":
        fits = high > printed
    else:
        least, largest = corners(p["p"])
        fits = low <= largest and high >= least
    if not fits:
        shown = _shown(low) if _shown(low) == _shown(high) else f"{_shown(low)} to {_shown(high)}"
        yield f"p {p['sign']} {p['p']} is printed, the statistic gives p = {shown}"


def _shown(p: float) -> str:
    return share(p, 3) if p >= 0.001 else f"{p:.1e}"


def _crosses(p: re.Match[str], allowed: tuple[float, float], level: float = 0.05) -> bool:
    printed = float(p["p"])
    if not 0 <= printed <= 1:
        return False
    claimed = printed <= level if p["sign"] == "<" else printed < level if p["sign"] == "=" else False
    return (claimed and allowed[0] > level) or (not claimed and allowed[1] < level)


def _eta_problems(df: tuple[str, ...], value: str, eta: re.Match[str]) -> Iterator[str]:
    first, second = (corners(d, whole_is_exact=True) for d in df)
    sizes = [f * a / (f * a + b) for f in corners(value) for a in first for b in second if f > 0]
    least, largest = corners(eta["eta"])
    before, after = eta["before"] or "", eta["after"] or ""
    partial = before.startswith("partial") or "p" in after
    # a generalized or plain eta squared may be smaller than the partial one, never larger
    if sizes and (max(sizes) < least or (partial and min(sizes) > largest)):
        yield f"η² = {eta['eta']} is printed, F and df give a partial η² of {share(float(np.mean(sizes)), 2)}"
        return
    if eta["low"] is None or not partial:
        return
    low, high = float(eta["low"]), float(eta["high"])
    f = np.maximum([float(value), *corners(value)], 0.0)
    df1, df2 = (np.full(3, float(n)) for n in df)
    bounds, *rounded = partial_eta_squared_ci(f, df1, df2, float(eta["level"]) / 100)
    # with few error df the interval of the noncentral F may end below the size, which is biased upwards
    if all(
        min(ends) - INTERVAL_TOLERANCE <= printed <= max(ends) + INTERVAL_TOLERANCE
        for printed, ends in zip((low, high), zip(bounds, *rounded, strict=True), strict=True)
    ):
        return
    if not low <= float(eta["eta"]) <= high:
        yield f"the interval [{eta['low']}, {eta['high']}] does not include its η² = {eta['eta']}"
        return
    yield (
        f"the {eta['level']}% interval [{eta['low']}, {eta['high']}] is not that of the noncentral F, "
        f"[{share(float(bounds[0]), 2)}, {share(float(bounds[1]), 2)}]"
    )
