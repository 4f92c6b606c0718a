"""Statistics reported in running text: found, recomputed from their own numbers, or not readable."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from itertools import zip_longest
from typing import Literal

import numpy as np

from analysis.paper.clause import own_clause
from analysis.paper.p_values import Kind, corners, p_range
from analysis.report.numbers import share
from analysis.within.eta_squared import partial_eta_squared_ci

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
    return any(not match[0].lower().startswith("un") for match in _CORRECTION.finditer(text))


def _p_problems(p: re.Match[str], allowed: tuple[float, float]) -> Iterator[str]:
    low, high = allowed
    printed = float(p["p"])
    if printed > 1 or printed < 0:
        yield f"p = {p['p']} is no probability"
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
    # a generalised or plain eta squared may be smaller than the partial one, never larger
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
        yield f"the interval [{eta['low']}, {eta['high']}] does not hold its own η² = {eta['eta']}"
        return
    yield (
        f"the {eta['level']}% interval [{eta['low']}, {eta['high']}] is not that of the noncentral F, "
        f"[{share(float(bounds[0]), 2)}, {share(float(bounds[1]), 2)}]"
    )
