"""The Methods paragraph: sentences whose every number names its source; plain text, LaTeX, HTML.

A sentence is a template with {name} for a number, {name:was|were} for the word that goes with one and with
several, and words for what was declared.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape

from experiments.assignment.checks import attention_by_block, motion_checks_by_block
from experiments.definition import Experiment
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


def sentences(
    experiment: Experiment,
    origin: str,
    recruiter: str,
    counted: Mapping[str, Number],
    rules: Sequence[tuple[str, str]],
) -> tuple[str, ...]:
    """The sentences that apply to a study.

    Parameters
    ----------
    rules : sequence of (str, str)
        Name of the number and words of each declared exclusion that a report has applied.
    """
    return (
        *_origin(origin),
        *_recruitment(recruiter, counted),
        *_screening(experiment),
        *_checks(experiment, counted),
        *_warnings(experiment),
        *_exclusions(experiment, rules),
        *_completed(experiment, counted),
    )


def _completed(experiment: Experiment, counted: Mapping[str, Number]) -> list[str]:
    if counted["complete"].value:
        return [*_display(experiment), *_evidence(counted)]
    return [
        "Nobody has completed a visit yet: how clips were shown, and whether answers were given by people, "
        "is told of completed visits."
    ]


def _origin(origin: str) -> list[str]:
    return (
        []
        if origin == PARTICIPANTS
        else [f"These visits are no data of participants: their origin is '{origin}'."]
    )


def _recruitment(recruiter: str, counted: Mapping[str, Number]) -> list[str]:
    through = "" if recruiter == "generic" else f", recruited through {RECRUITERS[recruiter]}"
    lines = [f"Visits begun: {{begun}}{through}; consent was given in {{agreed}}."]
    if counted["by_personal_link"].value:
        lines.append("By personal link came {by_personal_link}.")
    if counted["by_recruiter"].value:
        lines.append("The recruiter named the person in {by_recruiter}; data bear pseudonyms of this study.")
    lines.append(
        "Of all visits {complete} {complete:was|were} completed, {withdrew} ended at the person's wish, "
        "{screened_out} by screening, and {unfinished} {unfinished:was|were} left open."
    )
    if counted["erased"].value:
        lines.append("Erased afterwards, answers and consent with them: {erased}.")
    return lines


PARTICIPANTS = "participant"
RECRUITERS = {"prolific": "Prolific", "sona": "SONA", "mturk": "Amazon Mechanical Turk"}


def _screening(experiment: Experiment) -> list[str]:
    names = ", ".join(rule.rule.replace("_", " ") for rule in experiment.screening)
    return [f"Rules of screening, declared before the data: {names}."] if names else []


def declared(experiment: Experiment) -> dict[str, Number]:
    """The numbers of the paragraph that stand in the declaration."""
    keys = {
        "attention_per_block": ("attention.per_block", experiment.attention.per_block),
        "motion_checks_per_block": (
            "evidence.motion_checks.per_block",
            experiment.evidence.motion_checks.per_block,
        ),
    }
    return {name: Number(name, value, f"declaration: {key}") for name, (key, value) in keys.items()}


def _checks(experiment: Experiment, counted: Mapping[str, Number]) -> list[str]:
    lines = []
    if any(attention_by_block(experiment)):
        each = experiment.attention.per_block  # 0 where the switch for online recruitment alone asks
        number = f"{{attention_per_block}} instructed answer{'s' * (each != 1)} a block"
        answers = number if each else "instructed answers"
        lines.append(f"Attention was checked by {answers}; completed visits hold {{checks}}.")
    motion = experiment.evidence.motion_checks
    in_blocks = set(motion_checks_by_block(experiment))
    if any(in_blocks):
        number = f"In each block {{motion_checks_per_block}} short clip{'s' * (motion.per_block != 1)} showed"
        clips = number if in_blocks == {motion.per_block} else "Between the trials short clips showed"
        kinds = ", ".join(kind.replace("_", " ") for kind in motion.kinds)
        lines.append(
            f"{clips} what was asked by motion alone ({kinds}); of {{motion_checks}} answers to them in "
            "completed visits {motion_checks_right} {motion_checks_right:was|were} right."
        )
    if counted["motion_checks_other_way"].value:
        lines.append(
            "{motion_checks_other_way} {motion_checks_other_way:was|were} answered the other way that is "
            "offered to people who cannot see such clips."
        )
    return lines


def _warnings(experiment: Experiment) -> list[str]:
    names = ", ".join(rule.rule.replace("_", " ") for rule in experiment.warnings.rules)
    if not names:
        return []
    ends = (
        " {ended_by_warnings} {ended_by_warnings:was|were} ended since they went on."
        if experiment.warnings.then == "end"
        else ""
    )
    return [f"While taking part people were warned of {names}, in {{warned}} {{warned:visit|visits}}.{ends}"]


def _exclusions(experiment: Experiment, rules: Sequence[tuple[str, str]]) -> list[str]:
    by_hand = (
        "By hand, with a reason on record, {excluded_by_hand} "
        "{excluded_by_hand:visit was|visits were} excluded."
    )
    if not experiment.exclusions:
        return ["No exclusion was declared before the data.", by_hand]
    declared = ", ".join(rule.rule.replace("_", " ") for rule in experiment.exclusions)
    applied = "; ".join(f"{words}: {{{name}}}" for name, words in rules)
    counts = f" They left out: {applied}." if applied else ""
    return [f"Exclusions declared before the data: {declared}.{counts}", by_hand]


def _display(experiment: Experiment) -> list[str]:
    lines = [
        "Every clip was drawn frame by frame in the participant's browser and each frame's time recorded; of "
        "{plays} {plays:play|plays} in completed visits {plays_good} {plays_good:was|were} shown as "
        "declared, {plays_uncertain} could not be verified, {plays_flagged} {plays_flagged:was|were} flagged "
        "(a frame lost or late, or the view disturbed: the page left, zoomed or loaded anew), and "
        "{plays_failed} failed."
    ]
    if experiment.display.calibrate != "off":
        lines.append("The size on the screen was calibrated in {calibrated} of {complete} completed visits.")
    return lines


def _evidence(counted: Mapping[str, Number]) -> list[str]:
    judged = sum(counted[name].value for name in ("likely", "unclear", "unlikely"))
    if not judged:
        return [
            "Whether answers were given by people was not judged ({not_judged} completed "
            "{not_judged:visit brings|visits bring} no evidence)."
        ]
    lines = [
        "Automated answers: tickets of the server, the server's time, digests of the clips and summaries of "
        "key and pointer presses were gathered as evidence; by them {likely} completed "
        "{likely:visit was|visits were} likely a person's, {unclear} unclear, {unlikely} unlikely, and "
        "{not_judged} could not be judged.",
        "This is evidence, not proof: it does not tell a person who lets a program choose the answers.",
    ]
    return (
        [*lines, "Answers or views were refused in {refused} {refused:visit|visits}."]
        if counted["refused"].value
        else lines
    )
