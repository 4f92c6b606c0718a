"""A study from somebody's own clips: definition, manifest, and trials to begin from."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments import design
from experiments.declaration.clip_rating import SCALE_NAME
from experiments.declaration.experiment import Experiment
from experiments.declaration.tables import Display
from experiments.errors import InputError
from experiments.manifest import UPLOADED, Clip, Manifest
from experiments.own_clips import Placed, check_factorial, levels_of
from experiments.schema.canonical import definition_sha256
from server.core.errors import Conflict
from server.core.storage import ClipStore
from server.studies.schemas import OwnClips, PlacedClip
from server.transcoding.records import records_of
from video_conversion.prepared import Prepared, clip_name

# What participants do with one's own clips: trials to begin from, for an experimenter to edit further.

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
            f"a just-noticeable difference needs a factor with at least {MIN_STIMULI + 1} levels that are "
            f"all numbers, such as {{duration}} in blink_100_1.mp4; the factors are: {', '.join(levels)}"
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


# A study from somebody's own clips: definition and manifest.


class StillPreparing(Conflict, code="still_preparing"):
    """Clips of an upload are still being looked into or converted."""


def largest_of(placed: Placed, folder: Path) -> tuple[int, int]:
    """Greatest width and greatest height of an upload's clips, in pixels; 0 of those not looked into yet."""
    records = [record for name, record in records_of(folder).items() if name in placed]
    return (
        max((record.width_px for record in records), default=0),
        max((record.height_px for record in records), default=0),
    )


def definition_text(name: str, placed: Placed, asked: OwnClips, largest: tuple[int, int] = (0, 0)) -> str:
    """A definition as TOML, to be edited further: one factor per column, random order, the template's trial.

    Its smallest window holds the largest clip, `largest` pixels wide and high: in a smaller one the clip
    would be cut off at the sides, though every frame is shown.
    """
    import tomlkit  # takes a twentieth of the time of a start

    check_factorial(placed)
    cells = {tuple(levels.values()) for levels, _ in placed.values()}
    document = tomlkit.document()
    document.add(
        "name", tomlkit.item(re.sub(r"[^A-Za-z0-9_]", "_", f"s_{name}" if name[0].isdigit() else name)[:40])
    )
    document.add("title", tomlkit.item(asked.title))
    factors = tomlkit.aot()
    factor_levels = levels_of(placed)
    for factor, levels in factor_levels.items():
        table = tomlkit.table()
        table.add("name", factor)
        table.add("label", factor.replace("_", " ").capitalize())
        table.add("levels", [{"name": level, "label": level} for level in levels])
        factors.append(table)
    document.add("factors", factors)
    document.add("exemplars", tomlkit.item({"per_cell": len(placed) // len(cells)}))
    # Practice on most of the clips would show participants the study before it begins.
    document.add("practice", tomlkit.item({"trials": max(1, min(4, len(placed) // 3))}))
    document.add("trial", tomlkit.item(trial_of(asked, factor_levels)))
    document.add("display", tomlkit.item({"calibrate": "off"} | _window_for(*largest)))
    document.add("exclusions", tomlkit.item([{"rule": "incomplete"}, {"rule": "failed_plays"}]))
    document.add("texts", tomlkit.item({"en": _texts(asked)}))
    return tomlkit.dumps(document)


def _window_for(width: int, height: int) -> dict[str, int]:
    usual = Display()
    return {
        key: px
        for key, px in (("minimum_width_px", width), ("minimum_height_px", height))
        if px > getattr(usual, key)
    }


_START = "Press **Space** or **Enter**, or tap, to start"
_WATCHING = {
    "rating": f"{_START} a clip. You see it **once**. Then answer: ",
    "slider": f"{_START} a clip. You see it **once**. Then move the slider, by mouse or arrow keys: ",
    "sliders": f"{_START} a clip. You see it **once**. Then move the sliders. The first asks: ",
    "acr": f"{_START} a clip. You see it **once**. Then choose from *Bad* to *Excellent*: ",
    "dcr": f"{_START}. You see the reference and then, after a pause, a second clip, **once** each. Then "
    "choose from *Very annoying* to *Imperceptible*: ",
    "pairs": f"{_START} two clips side by side. You see them **once**. Then answer: ",
    "just_noticeable": f"{_START} two clips, one after the other. You see them **once**. Then answer: ",
}


_TASK = {"pairs": "compare two at a time", "just_noticeable": "compare two at a time"}
"""What is done with the clips, where it is not the rating of each."""


def _texts(asked: OwnClips) -> dict[str, str]:
    task = _TASK.get(asked.template, "rate each of them")
    return {
        "consent": f"# Taking part\n\nYou will watch short clips and {task}. "
        "Taking part is voluntary: you may choose *I do not agree*, and stop at any time with *Stop*. "
        "Your name and internet address are not stored.\n",
        "instructions": f"# What you will do\n\n{_WATCHING[asked.template]}*{asked.question}*\n",
        "debrief": "# Thank you\n\nYour answers are stored.\n",
    }


def merged_manifest(known: Manifest, added: Manifest) -> Manifest:
    """`known` with the clips of `added`: those of a cell and exemplar known already take its place.

    Checks that are added take the place of all that were known.
    """
    clips = {(clip.cell, clip.exemplar): clip for clip in known.clips}
    clips |= {(clip.cell, clip.exemplar): clip for clip in added.clips}
    checks = {"checks": added.checks, "checks_seed": added.checks_seed} if added.checks else {}
    return known.model_copy(update={"clips": tuple(clips.values()), **checks})


def check_declared(added: Manifest, experiment: Experiment) -> None:
    """InputError for the first of these clips that has no place in the design."""
    declared = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    stray = next((clip for clip in added.clips if (clip.cell, clip.exemplar) not in declared), None)
    if stray is not None:
        raise InputError(
            f"'{stray.file}' is exemplar {stray.exemplar} of the cell {stray.cell}, which the definition "
            f"does not declare. Add its level, or more clips per cell, in the builder. Both are saved "
            f"together"
        )


def only_declared(manifest: Manifest, experiment: Experiment) -> Manifest:
    """`manifest` without clips of cells and exemplars that the definition does not declare."""
    declared = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    kept = tuple(clip for clip in manifest.clips if (clip.cell, clip.exemplar) in declared)
    return manifest.model_copy(update={"clips": kept}) if kept else manifest


def places_in(folder: Path, places: Sequence[PlacedClip]) -> Placed:
    """The cells of an upload's clips, of those of a whole study."""
    hashes = {name: record.sha256 for name, record in records_of(folder).items()}
    return {
        clip.file: (clip.levels, clip.exemplar)
        for clip in places
        if hashes.get(clip.file) == clip.clip_sha256
    }


def placed_manifest(
    known: Manifest, added: Manifest | None, places: Sequence[PlacedClip], experiment: Experiment
) -> Manifest:
    """`known` with the clips that `places` lists, in their cells; InputError for a clip of neither."""
    if any(clip.profile or clip.inputs for clip in known.clips):
        raise InputError(
            "the clips of this study were rendered for their cells; only uploaded clips can move"
        )
    of_either = (*known.clips, *(added.clips if added is not None else ()))
    clips = {(clip.sha256, clip.file): clip for clip in of_either}
    moved = []
    for clip in places:
        source = clips.get((clip.clip_sha256, clip_name(clip.file)))
        if source is None:
            raise InputError(f"'{clip.file}' is neither a clip of this study nor of the upload")
        if set(clip.levels) != set(experiment.factor_names):
            raise InputError(
                f"'{clip.file}': expected a level of each of {', '.join(experiment.factor_names)}, "
                f"got {', '.join(clip.levels) or 'none'}"
            )
        levels = {factor: clip.levels[factor] for factor in experiment.factor_names}
        where = {"levels": levels, "cell": "/".join(levels.values()), "exemplar": clip.exemplar}
        moved.append(source.model_copy(update=where))
    if not moved:
        raise InputError("expected at least one clip in a cell, got none")
    return known.model_copy(update={"clips": tuple(moved)})


def manifest_of(experiment: Experiment, placed: Placed, folder: Path) -> Manifest:
    """The manifest of uploaded clips, as they were prepared.

    Raises
    ------
    InputError
        A file cannot be a clip, or levels of a factor are missing.
    StillPreparing
        Not every file has been looked into.
    """
    order, records = experiment.factor_names, records_of(folder)
    if waiting := [name for name in placed if name not in records]:
        raise StillPreparing(
            f"{len(waiting)} of {len(placed)} clips are still being checked or converted. Try again in a "
            f"moment."
        )
    clips = []
    for name, (levels, exemplar) in sorted(placed.items()):
        if missing := [factor for factor in order if factor not in levels]:
            raise InputError(f"the clips have no levels for '{missing[0]}', a factor of the definition")
        if (problem := records[name].problem) is not None:
            raise InputError(f"'{name}' cannot be used: {problem}")
        clips.append(_clip(records[name], {factor: levels[factor] for factor in order}, exemplar))
    return Manifest(
        experiment=experiment.name,
        definition_sha256=definition_sha256(experiment),
        program_version=UPLOADED,
        seed=experiment.exemplars.seed,
        clips=tuple(clips),
    )


def _clip(record: Prepared, levels: dict[str, str], exemplar: int) -> Clip:
    return Clip(
        levels=levels,
        cell="/".join(levels.values()),
        exemplar=exemplar,
        file=clip_name(record.name),
        sha256=record.sha256,
        bytes=record.bytes,
        fps=record.fps,
        frames=record.frames,
        width_px=record.width_px,
        height_px=record.height_px,
        source=record.source,
    )


def store_prepared(store: ClipStore, manifest: Manifest, folder: Path) -> None:
    """Take an upload's clips, and the originals of those that were converted, into the clip store."""
    files = {clip_name(record.name): record for record in records_of(folder).values()}
    for clip in manifest.clips:
        record = files[clip.file]
        store.adopt(folder / record.clip, record.sha256)
        if record.source is not None:
            store.adopt(folder / record.name, record.source.sha256)
