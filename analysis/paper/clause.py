"""How far behind a statistic its own p and effect size stand: to where another clause begins."""

import re

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
"""So many words that reports of statistics do not have may stand between one and its p."""


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
