"""The clauses of the Methods paragraph, each from the data of the visits, and the paragraph."""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from html import escape

from experiments.assignment.order import attention_by_block, motion_checks_by_block
from experiments.declaration.experiment import Experiment
from experiments.rules import ExclusionRule, ScreeningRule
from server.participation.recruiter import NAMES
from server.results.methods_repository import Number, UsedVersion, begun_with

# The Methods paragraph: sentences whose every number names its source; plain text, LaTeX, HTML.
# A sentence is a template. {name} is a number, {name:was|were} is the word for one and for several, and the
# rest describes what was declared.

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
            lines.append(_latex_text(self._filled(sentence, {}, "{value}")))
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
        def agreeing(word: re.Match[str]) -> str:
            return word[2] if self.numbers[word[1]].value == 1 else word[3]

        def number(hole: re.Match[str]) -> str:
            name, before = hole[1], agreed[: hole.start()]
            begins = not before or before.endswith(". ")
            value = in_words(self.numbers[name].value, begins=begins)
            if self.numbers[name].value == 0 and _STANDS_ALONE.match(agreed, hole.end()):
                value = "None" if begins else "none"
            return form.format(value=value, mark=order.get(name, 0))

        agreed = _AGREEING.sub(agreeing, sentence)
        return _HOLE.sub(number, agreed)


_STANDS_ALONE = re.compile(r" (?:consented|completed it|w[ae][sr]e?|could)\b")
"""What follows a number without a noun: there a zero is called none."""
UNITS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def in_words(value: int, *, begins: bool = False) -> str:
    """A number as APA style writes it: a word below ten, and no numeral at the beginning of a sentence.

    Examples
    --------
    >>> in_words(4), in_words(12), in_words(4, begins=True), in_words(12, begins=True)
    ('four', '12', 'Four', 'A total of 12')
    """
    if 0 <= value < len(UNITS):
        return UNITS[value].capitalize() if begins else UNITS[value]
    return f"A total of {value}" if begins else str(value)


def _latex_text(text: str) -> str:
    return "".join(LATEX_SIGNS.get(sign, sign) for sign in text)


# The clauses of the Methods paragraph: each states what the data of the visits show, or is left out.
#
# What a declaration says holds for the visits that began with it. A series may have several versions whose
# rules differ, so each rule is stated with the visits it was in force for.

PARTICIPANTS = "participant"


@dataclass
class DescribedSeries:
    """What the paragraph is about.

    Attributes
    ----------
    experiment : Experiment
        As the newest version of the series declares it.
    used : sequence of (UsedVersion, Experiment)
        The versions of the series that visits were begun with, oldest first.
    rules : sequence of (str, str)
        Name of the number and words of each declared exclusion rule that a report has applied.
    is_open : bool
        Whether people may still be taking part.
    elsewhere : str
        Where visits are, in words, if this series has none; empty otherwise.
    numbers : dict of str to Number
        Of the paragraph; clauses add those that they need.
    """

    study: int
    origin: str
    series: int
    experiment: Experiment
    used: Sequence[tuple[UsedVersion, Experiment]]
    rules: Sequence[tuple[str, str]]
    elsewhere: str
    is_open: bool
    numbers: dict[str, Number] = field(default_factory=dict)

    def value(self, name: str) -> int:
        """A number of the paragraph."""
        return self.numbers[name].value

    def number(self, name: str, value: int, source: str) -> str:
        """Add a number; return its hole in a sentence."""
        self.numbers[name] = Number(name, value, source)
        return f"{{{name}}}"

    def begun_with(self, versions: Iterable[int]) -> str:
        """The name of the number of visits that began with one of these versions."""
        numbers = set(versions)
        visits = sum(version.begun for version, _ in self.used if version.number in numbers)
        number = begun_with(self.study, self.origin, self.series, sorted(numbers), visits)
        self.numbers[number.name] = number
        return number.name


def declared_numbers(experiment: Experiment) -> dict[str, Number]:
    """The numbers of the paragraph that the declaration gives."""
    values = {
        "attention_per_block": ("attention.per_block", experiment.attention.per_block),
        "motion_checks_per_block": (
            "evidence.motion_checks.per_block",
            experiment.evidence.motion_checks.per_block,
        ),
    }
    return {name: Number(name, value, f"declaration: {key}") for name, (key, value) in values.items()}


def sentences(of: DescribedSeries) -> tuple[str, ...]:
    """The sentences that apply to the visits of a study."""
    return (
        *_origin(of),
        *_recruitment(of),
        *_screening(of),
        *_warnings(of),
        *_exclusions(of),
        *_completed_clauses(of),
    )


def _completed_clauses(of: DescribedSeries) -> list[str]:
    if of.value("complete"):
        return [*_checks(of), *_display(of), *_evidence(of)]
    return [
        "No participant has completed the study yet. Presentation of clips and evidence of human answers "
        "are reported for completed visits."
    ]


def _origin(of: DescribedSeries) -> list[str]:
    if of.origin == PARTICIPANTS:
        return []
    return [f"These visits are not data from participants: their origin is '{of.origin}'."]


def _recruitment(of: DescribedSeries) -> list[str]:
    if of.elsewhere:
        return [f"{of.elsewhere}; data series {of.series} has no visits yet."]
    # Someone who starts over has two visits: then only visits can be counted.
    lines = [
        "{begun} {begun:visit was|visits were} begun; consent was given in {agreed}, and {complete} "
        "{complete:was|were} completed."
        if of.value("restarted")
        else "{begun} {begun:participant|participants} began the study; {agreed} consented, and {complete} "
        "completed it."
    ]
    lines += [
        f"{{by_{kind}}} {{by_{kind}:participant was|participants were}} recruited through {name}."
        for kind, name in NAMES.items()
        if of.value(f"by_{kind}")
    ]
    if of.value("by_personal_link"):
        lines.append("{by_personal_link} {by_personal_link:participant|participants} used a personal link.")
    if of.value("by_recruiter"):
        lines.append(
            "The link identified the participant in {by_recruiter} {by_recruiter:visit|visits}; the data "
            "contain pseudonyms instead."
        )
    lines += _ways_visits_ended(of)
    if of.value("erased"):
        lines.append(
            "The data of {erased} {erased:visit|visits}, including answers and consent, were erased later."
        )
    return lines


def _ways_visits_ended(of: DescribedSeries) -> list[str]:
    """How the visits that were not completed ended; ways without a visit are left out."""
    ways = {
        "declined": "{declined} ended because consent was declined",
        "withdrew": "{withdrew} {withdrew:was|were} withdrawn by the participant",
        "screened_out": "{screened_out} {screened_out:was|were} screened out",
        "restarted": "{restarted} {restarted:was|were} replaced by a new visit of the same participant",
        "unfinished": "{unfinished} {unfinished:was|were} "
        + ("unfinished or still in progress" if of.is_open else "not finished"),
    }
    ends = [words for name, words in ways.items() if of.value(name)]
    if not ends:
        return []
    listed = " and ".join(ends) if len(ends) < 3 else _joined_parts(ends)
    return [f"Of the visits that were not completed, {listed}."]


def _joined_parts(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])}, and {parts[-1]}"


Rule = ScreeningRule | ExclusionRule


def _in_force(
    of: DescribedSeries, rules_of: Callable[[Experiment], Sequence[Rule]]
) -> tuple[list[str], dict[tuple[int, ...], list[str]]]:
    """Words of the rules that held for every visit, and those of others by the versions that have them.

    A rule whose limits were changed is another rule.
    """
    versions: dict[str, list[int]] = {}
    names: dict[str, str] = {}
    every = of.used or [(UsedVersion(0, 0, 0), of.experiment)]
    for version, experiment in every:
        for rule in rules_of(experiment):
            key = rule.model_dump_json()
            names[key] = rule.reason()
            versions.setdefault(key, []).append(version.number)
    always = list(dict.fromkeys(names[key] for key, used in versions.items() if len(used) == len(every)))
    partly: dict[tuple[int, ...], list[str]] = {}
    for key, used in versions.items():
        if len(used) < len(every):
            partly.setdefault(tuple(used), []).append(names[key])
    return always, partly


def _screening(of: DescribedSeries) -> list[str]:
    always, partly = _in_force(of, lambda experiment: experiment.screening)
    lines = (
        [f"The following reasons for screening were declared before data collection: {'; '.join(always)}."]
        if always
        else []
    )
    for versions, names in partly.items():
        visits = of.begun_with(versions)
        lines.append(
            f"The following reasons for screening applied to {{{visits}}} of {{begun}} visits: "
            f"{'; '.join(names)}."
        )
    return lines


def _warnings(of: DescribedSeries) -> list[str]:
    rules = [rule for _, experiment in of.used for rule in experiment.warnings.rules]
    names = ", ".join(dict.fromkeys(rule.rule.replace("_", " ") for rule in rules))
    if not names and not of.value("warned"):
        return []
    if not of.value("warned"):
        return [f"Warnings about {names} were declared, but no participant was warned."]
    ended = (
        " {ended_by_warnings} {ended_by_warnings:visit was|visits were} ended because such answers continued."
        if of.value("ended_by_warnings")
        else ""
    )
    return [f"Participants were warned about {names} in {{warned}} {{warned:visit|visits}}.{ended}"]


def _exclusions(of: DescribedSeries) -> list[str]:
    lines = _declared_exclusions(of)
    if of.rules:
        lines.append(f"The analysis excluded {'; '.join(words for _, words in of.rules)}.")
    if of.value("excluded_by_hand"):
        lines.append(
            "{excluded_by_hand} {excluded_by_hand:visit was|visits were} excluded manually, with a "
            "recorded reason."
        )
    elif of.value("begun"):
        lines.append("No visit was excluded manually.")
    return lines


def _declared_exclusions(of: DescribedSeries) -> list[str]:
    """The rules of the newest version, which the analysis follows: declared before every visit, or later."""
    always, _ = _in_force(of, lambda experiment: experiment.exclusions)
    now = {rule.model_dump_json(): rule.reason() for rule in of.experiment.exclusions}
    before = [name for name in dict.fromkeys(now.values()) if name in always]
    later: dict[tuple[int, ...], list[str]] = {}
    for key, name in now.items():
        without = tuple(
            version.number
            for version, experiment in of.used
            if key not in {rule.model_dump_json() for rule in experiment.exclusions}
        )
        if without:
            later.setdefault(without, []).append(name)
            before = [one for one in before if one != name]
    lines = (
        [f"The following reasons for exclusion were declared before data collection: {'; '.join(before)}."]
        if before
        else []
    )
    for without, names in later.items():
        visits = of.begun_with(without)
        lines.append(
            f"The following reasons for exclusion were declared or changed after {{{visits}}} "
            f"{{{visits}:visit|visits}} had begun: {'; '.join(names)}."
        )
    return lines or ["No exclusion rule was declared before data collection."]


def _numbers_asked(
    of: DescribedSeries, by_block: Callable[[Experiment], Sequence[int]]
) -> list[tuple[int, ...]]:
    """How many are asked in each block, of the versions that completed visits had, each once."""
    return sorted({tuple(by_block(experiment)) for version, experiment in of.used if version.complete})


def _number_in_each(asked: Sequence[tuple[int, ...]]) -> int | None:
    """The number in each block, where every block of every visit had the same."""
    numbers = {number for blocks in asked for number in blocks}
    return numbers.pop() if len(numbers) == 1 else None


def _number_changed(asked: Sequence[tuple[int, ...]]) -> str:
    """That the number was changed, where it was."""
    totals = sorted({sum(blocks) for blocks in asked})
    return f"; their number per visit was changed ({', '.join(map(str, totals))})" if len(totals) > 1 else ""


def _checks(of: DescribedSeries) -> list[str]:
    lines = []
    asked = _numbers_asked(of, attention_by_block)
    if of.value("checks"):
        each = _number_in_each(asked)
        how = "instructed-response items" + _number_changed(asked)
        if each:
            number = of.number("attention_per_block", each, "declaration: attention.per_block")
            how = f"{number} instructed-response {{attention_per_block:item|items}} per block"
        lines.append(
            f"Attention was checked with {how}; completed visits contained {{checks}} "
            f"{{checks:answer|answers}} to these checks."
        )
    lines += _motion_checks(of)
    if of.value("motion_checks_other_way"):
        lines.append(
            "{motion_checks_other_way} {motion_checks_other_way:was|were} answered by the alternative "
            "offered to people who cannot see such clips."
        )
    return lines


def _motion_checks(of: DescribedSeries) -> list[str]:
    if not of.value("motion_checks") + of.value("motion_checks_other_way"):
        return []
    asked = _numbers_asked(of, motion_checks_by_block)
    every = [
        kind
        for version, experiment in of.used
        if version.complete and any(motion_checks_by_block(experiment))
        for kind in experiment.evidence.motion_checks.kinds
    ]
    kinds = ", ".join(dict.fromkeys(kind.replace("_", " ") for kind in every))
    each = _number_in_each(asked)
    shown = "Short clips between the trials showed"
    if each:
        source = "declaration: evidence.motion_checks.per_block"
        number = of.number("motion_checks_per_block", each, source)
        shown = f"In each block, {number} short {{motion_checks_per_block:clip|clips}} showed"
    return [
        f"{shown} content defined by motion only ({kinds}){_number_changed(asked)}; of {{motion_checks}} "
        "{motion_checks:answer|answers} in completed visits, {motion_checks_right} "
        "{motion_checks_right:was|were} correct."
    ]


def _display(of: DescribedSeries) -> list[str]:
    lines = []
    if of.value("plays"):
        lines += [_drawing_clause(of), _as_declared(of)]
    if of.experiment.display.calibrate != "off":
        lines.append(
            "The physical size of clips was calibrated in {calibrated} of {complete} completed "
            "{complete:visit|visits}."
        )
    return lines


def _drawing_clause(of: DescribedSeries) -> str:
    if of.value("plays_by_frame") == of.value("plays"):
        recorded = of.value("plays_good") == of.value("plays")
        times = " and each frame's time recorded" if recorded else ""
        return f"Every clip was drawn frame by frame in the participant's browser{times}."
    ways = []
    if of.value("plays_by_frame"):
        ways.append("drawn frame by frame in {plays_by_frame}")
    if of.value("plays_by_video"):
        ways.append("shown by the browser's video element in {plays_by_video}")
    if of.value("plays_not_drawn"):
        ways.append("not shown at all in {plays_not_drawn}")
    listed = " and ".join(ways) if len(ways) < 3 else _joined_parts(ways)
    return f"Of {{plays}} {{plays:presentation|presentations}} in completed visits, the clip was {listed}."


def _as_declared(of: DescribedSeries) -> str:
    parts = ["{plays_good} {plays_good:was|were} shown as declared"]
    if of.value("plays_uncertain"):
        parts.append("{plays_uncertain} could not be verified")
    if of.value("plays_flagged"):
        reasons = "; ".join(_reasons(of))
        parts.append(f"{{plays_flagged}} {{plays_flagged:was|were}} flagged ({reasons})")
    if of.value("plays_failed"):
        parts.append("{plays_failed} failed")
    listed = " and ".join(parts) if len(parts) < 3 else _joined_parts(parts)
    return f"Of {{plays}} {{plays:presentation|presentations}} in completed visits, {listed}."


def _reasons(of: DescribedSeries) -> list[str]:
    start = "plays_flagged_by_"
    return [
        f"{name.removeprefix(start).removeprefix('flagged_').replace('_', ' ')}: {{{name}}}"
        for name in of.numbers
        if name.startswith(start)
    ]


VERDICT_WORDS = {"likely": "likely human", "unclear": "unclear", "unlikely": "unlikely human"}


def _verdicts(of: DescribedSeries) -> str:
    """How many visits have each verdict; verdicts that none has are left out."""
    parts: list[str] = []
    for name, word in VERDICT_WORDS.items():
        if of.value(name):
            forms = f"{{{name}:was|were}}" if parts else f"completed {{{name}:visit was|visits were}}"
            parts.append(f"{{{name}}} {forms} {word}")
    if of.value("not_judged"):
        parts.append("{not_judged} could not be judged")
    return " and ".join(parts) if len(parts) < 3 else _joined_parts(parts)


def _evidence(of: DescribedSeries) -> list[str]:
    judged = sum(of.value(name) for name in ("likely", "unclear", "unlikely"))
    if not judged:
        return [
            "Human answers could not be verified, because {not_judged} completed {not_judged:visit "
            "provided|visits provided} no evidence."
        ]
    lines = [
        f"To detect automated answers, {_evidence_gathered(of)}. Based on this evidence, {_verdicts(of)}.",
        "This evidence is not proof: it cannot detect a person who lets a program choose the answers.",
    ]
    if of.value("refused"):
        lines.append("Answers or views were refused in {refused} {refused:visit|visits}.")
    return lines


def _evidence_gathered(of: DescribedSeries) -> str:
    """What was gathered as evidence; with numbers where it was not of every completed visit."""
    kinds: Mapping[str, str] = {
        "with_tickets": "server tickets with server times",
        "with_digests": "digests of the clips",
        "with_presses": "summaries of key and pointer presses",
    }
    parts: list[str] = []
    for name, words in kinds.items():
        visits = of.value(name)
        if visits or name == "with_tickets":
            everywhere = visits == of.value("complete")
            parts.append(words if everywhere else f"{words} (in {{{name}}} {{{name}:visit|visits}})")
    return f"{' and '.join(parts) if len(parts) < 3 else _joined_parts(parts)} were recorded"
