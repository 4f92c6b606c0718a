"""What participants do with one's own clips: trials to begin from, for an experimenter to edit further."""

import re
from collections.abc import Sequence
from typing import Any

from experiments.errors import InputError
from experiments.trials.clip_rating.scales.scale import SCALE_NAME
from server.studies.clip_schemas import OwnClips

Levels = dict[str, list[str]]
"""Factor -> the names of its levels."""
QUALITY = ("Bad", "Poor", "Fair", "Good", "Excellent")
"""The five categories of absolute category rating, worst first (ITU-T P.910, 7.1)."""
IMPAIRMENT = (
    "Very annoying", "Annoying", "Slightly annoying", "Perceptible, but not annoying", "Imperceptible",
)  # fmt: skip
"""The five categories of degradation category rating, worst first (ITU-T P.910, 7.2)."""
REFERENCE = "reference"
"""The level of a factor that names the reference by itself."""
MIN_STIMULI = 3
_HOW = re.compile(r"how ([a-z]{3,40}) (?:was|is|were|are|did|does|do)\b", re.IGNORECASE)
_NOT_ASKED_FOR = {"much", "many", "often", "well", "long", "would", "pleasant"}
"""Words behind 'how' that name no scale, and the name of the second slider."""


def trial_of(asked: OwnClips, levels: Levels) -> dict[str, Any]:
    """The [trial] of a template; InputError where these clips cannot be asked about so."""
    match asked.template:
        case "rating":
            return {"kind": "clip_rating", "scale": _points(asked)}
        case "slider":
            return {"kind": "clip_rating", "scale": _slider(asked)}
        case "sliders":
            return {"kind": "clip_rating", "arrangement": "one_screen", "scales": _sliders(asked)}
        case "acr":
            return {"kind": "clip_rating", "scale": _categories(asked, QUALITY)}
        case "dcr":
            return _degradation(asked, levels)
        case "pairs":
            return _pairs(asked)
        case "just_noticeable":
            return _just_noticeable(asked, levels)


def _points(asked: OwnClips) -> dict[str, Any]:
    return {"question": {"en": asked.question}, "low": {"en": asked.low}, "high": {"en": asked.high}}


def _scale_name(question: str) -> str:
    """`natural` of 'How natural was this clip?'; `rating` where a question does not say it so."""
    fit = _HOW.match(question)
    word = fit[1].lower() if fit else ""
    return word if word and word not in _NOT_ASKED_FOR else SCALE_NAME


def _slider(asked: OwnClips) -> dict[str, Any]:
    return {"name": _scale_name(asked.question), "type": "slider", **_points(asked)}


def _sliders(asked: OwnClips) -> list[dict[str, Any]]:
    pleasant = {"question": {"en": "How pleasant was this clip?"}}
    return [
        _slider(asked),
        {
            "name": "pleasant", "type": "slider", **pleasant,
            "low": {"en": "very unpleasant"}, "high": {"en": "very pleasant"},
        },
    ]  # fmt: skip


def _categories(asked: OwnClips, labels: Sequence[str]) -> dict[str, Any]:
    return {
        "question": {"en": asked.question},
        "minimum": 1,
        "maximum": len(labels),
        "labels": [{"en": label} for label in labels],
    }


def _degradation(asked: OwnClips, levels: Levels) -> dict[str, Any]:
    """Each clip after its reference: the level of this name, else the first of the first factor."""
    named = ((factor, level) for factor, of in levels.items() for level in of if level.lower() == REFERENCE)
    factor, level = next(named, next((name, of[0]) for name, of in levels.items()))
    reference = {"factor": factor, "level": level, "label": {"en": "Reference"}, "rate_itself": True}
    return {"kind": "clip_rating", "scale": _categories(asked, IMPAIRMENT), "reference": reference}


def _pairs(asked: OwnClips) -> dict[str, Any]:
    return {
        "kind": "paired_comparison",
        "question": {"en": asked.question},
        "pairs": {"among": "all", "exemplars": "matched"},
        "presentation": {"arrangement": "side_by_side", "gap_mm": 8.0, "if_too_narrow": "stack"},
        "ties": {"label": {"en": "No difference"}},
    }


def _just_noticeable(asked: OwnClips, levels: Levels) -> dict[str, Any]:
    """Which of two clips, the standard or a stimulus? The standard is the lowest of a factor of numbers."""
    factor = next((name for name in levels if _numbers(levels[name])), None)
    if factor is None:
        raise InputError(
            f"a just-noticeable difference needs a factor with {MIN_STIMULI + 1} levels or more that are all "
            f"numbers, such as {{duration}} in blink_100_1.mp4; the factors are: {', '.join(levels)}"
        )
    standard = min(levels[factor], key=float)
    return {
        "kind": "threshold",
        "question": {"en": asked.question},
        "stimulus": {"factor": factor},
        "task": {
            "asks": "two_interval", "standard": standard,
            "first": {"en": "The first"}, "second": {"en": "The second"}, "gap_ms": 500,
        },
        "stop": {"trials": 40, "at_least": 20},
    }  # fmt: skip


def _numbers(levels: list[str]) -> bool:
    try:
        return len({float(level) for level in levels}) > MIN_STIMULI
    except ValueError:
        return False
