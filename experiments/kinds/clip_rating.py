"""Ratings of single clips: checks of the declaration, assignment, page model, columns."""

import random
from dataclasses import replace
from typing import Literal

from experiments import design
from experiments.assignment import Shown, Trial
from experiments.assignment.groups import seat_of
from experiments.assignment.order import single_clips
from experiments.assignment.shares import lines, share
from experiments.columns import base
from experiments.columns.base import rows_of
from experiments.columns.column import Column
from experiments.columns.playback import answer_columns
from experiments.columns.view import Dialect, View
from experiments.declaration.base import Declaration, Translated
from experiments.declaration.clip_rating import (
    MAX_FRAMES_LOGGED,
    SCALE_NAME,
    AnyScale,
    ClipRating,
    Points,
    RatingAnswer,
    RatingReference,
    check_response,
    clip_rating_of,
)
from experiments.declaration.experiment import Experiment
from experiments.declaration.factors import Factor
from experiments.declaration.trial import BlockSpec
from experiments.errors import did_you_mean
from experiments.kinds.kind import Kind
from experiments.schema.effects import Effect

# Checks of declared single-clip ratings against the rest of the experiment.


def fault(experiment: Experiment) -> str | None:
    """More views of a long performance than a trial may log, or a reference that does not fit."""
    trial = clip_rating_of(experiment)
    levels = [level.render for factor in experiment.factors for level in factor.levels]
    settings = [experiment.render, *(level.applied_to(experiment.render) for level in levels)]
    if trial.reference and any(one.performance for one in settings):
        return "trial.reference: performances cannot have a reference; remove it, or show single blinks"
    if trial.reference and (wrong := fault_of_reference(trial.reference, experiment)):
        return wrong
    longest = max((round(one.seconds * one.fps) for one in settings if one.performance), default=0)
    if longest * trial.views <= MAX_FRAMES_LOGGED:
        return None
    return (
        f"trial.views: {trial.views} views of {longest} frames exceed the {MAX_FRAMES_LOGGED} frames that "
        f"a trial may log; use shorter clips, fewer frames per second or fewer views"
    )


def fault_of_reference(reference: RatingReference, experiment: Experiment) -> str | None:
    """What does not fit the design, as `path: what to do`; None if everything fits."""
    return (
        _fault_of_clip(reference, experiment)
        or _fault_of_difference(reference, experiment)
        or (None if reference.rate_itself else _fault_of_rest(reference, experiment))
    )


def _fault_of_clip(reference: RatingReference, experiment: Experiment) -> str | None:
    if reference.factor is None:
        cells = ["/".join(level for _, level in cell) for cell in design.cells(experiment)]
        if reference.cell not in cells:
            return (
                f"trial.reference.cell: the design has no cell '{reference.cell}'"
                f"{did_you_mean(str(reference.cell), cells)}"
            )
        return None
    if reference.factor not in experiment.factor_names:
        nearest = did_you_mean(reference.factor, experiment.factor_names)
        return f"trial.reference.factor: no factor is called '{reference.factor}'{nearest}"
    factor = experiment.factor(reference.factor)
    names = [level.name for level in factor.levels]
    if reference.level not in names:
        return (
            f"trial.reference.level: '{reference.factor}' has no level '{reference.level}'"
            f"{did_you_mean(str(reference.level), names)}"
        )
    return _fault_of_factor(factor)


def _fault_of_factor(factor: Factor) -> str | None:
    if factor.between or factor.dealt:
        return (
            f"trial.reference.factor: participants see only some levels of '{factor.name}'; use a factor "
            f"whose levels everyone sees"
        )
    return None


def _differing(reference: RatingReference, experiment: Experiment) -> list[str]:
    """The factors in which a reference can differ from its clip, in declared order."""
    return [
        factor.name
        for factor in experiment.factors
        if len(factor.levels) > 1
        and (factor.name == reference.factor if reference.cell is None else not factor.between)
    ]


def _fault_of_difference(reference: RatingReference, experiment: Experiment) -> str | None:
    """A reference must differ from some clips, and show the same blink as each clip."""
    differing = _differing(reference, experiment)
    if not differing:
        return (
            "trial.reference: every clip would be its own reference; use a factor of which each "
            "participant sees at least two levels"
        )
    own = next((name for name in differing if name in experiment.exemplars.own_per), None)
    if own is not None:
        return (
            f"exemplars.own_per: a reference must show the same blink as its clip, but '{own}', in which "
            f"they differ, has different blinks at each level; remove '{own}' from own_per"
        )
    return None


def _fault_of_rest(reference: RatingReference, experiment: Experiment) -> str | None:
    """Without the reference's own trials, the rated cells must still form a crossed design."""
    hidden = "or set rate_itself = true"
    split = experiment.blocks.split_by
    if reference.factor is None and len(experiment.factors) > 1:
        return (
            f"trial.reference.cell: without ratings of '{reference.cell}', the rated cells are not fully "
            f"crossed; use factor and level, {hidden}"
        )
    name = reference.factor or experiment.factor_names[0]
    if split == name:
        return (
            f"blocks.split_by: the block of the reference's level of '{name}' would be empty; split by "
            f"another factor, {hidden}"
        )
    if len(experiment.factor(name).levels) < 3:
        return (
            f"trial.reference: '{name}' needs at least two levels in addition to the reference's; add a "
            f"level, {hidden}"
        )
    return None


# Exports of a single-clip rating: the base columns and the rating, one row per scale and presentation.
# A payload with one number is from a [trial.scale]; one with `answers` has one object per scale.

ANSWER: tuple[Column, ...] = (
    Column(
        "scale",
        "text",
        "Name of the scale: rating if the study has a single scale; empty in checks.",
        source="CASE WHEN a.kind IN ('attention', 'check') THEN NULL ELSE e.key END",
    ),
    Column(
        "response",
        "number",
        "The rating as chosen on the scale, even if the scale is reverse-keyed; empty if not_applicable "
        "was chosen.",
        source="e.value",
        member="response",
    ),
    Column(
        "not_applicable",
        "boolean",
        "True if the additional answer (cannot say) was chosen.",
        source="e.value",
        member="not_applicable",
        otherwise="false",
    ),
    Column(
        "expected_response",
        "integer",
        "The required answer in an attention check, or the correct answer in a motion check.",
        source="a",
    ),
    Column(
        "scale_rt",
        "number",
        "Response time from the clip's last frame to the answer on this scale, if there are several scales.",
        unit="ms",
        minimum=0,
        source="e.value",
        member="rt",
    ),
)

_EACH: dict[Dialect, str] = {
    "sqlite": "JOIN json_each(coalesce(json_extract(t.payload, '$.answers'), "
    f"json_object('{SCALE_NAME}', json(t.payload)))) e\n",
    "postgresql": "CROSS JOIN LATERAL json_each(coalesce(t.payload -> 'answers', "
    f"json_build_object('{SCALE_NAME}', t.payload))) e\n",
}


REFERENCE: tuple[Column, ...] = (
    Column(
        "reference",
        "text",
        "Cell of the reference clip shown before the rated clip; empty if the study has none.",
        source="xc.cell",
    ),
    Column(
        "reference_gap_ms",
        "number",
        "Time from the last drawn frame of the reference to the first drawn frame of the rated clip.",
        unit="ms",
        minimum=0,
        source="t.payload",
        member="reference_gap_ms",
    ),
)


def _rows(dialect: Dialect) -> str:
    return rows_of("clip_rating", {"shown": "c", "reference": "xc"}, _EACH[dialect])


RATINGS = View(
    name="ratings",
    title="Ratings: one row per presentation, or one per scale and presentation",
    columns=answer_columns((*base.CLIP, *REFERENCE), ANSWER),
    rows=_rows,
)


# What the participant's page receives about a single-clip rating.
# A separate model, so that a key added to the declaration reaches participants only when it is added here
# too.


class ShownRatingReference(Declaration):
    """The label of the reference and the length of the blank gap after it, but not which clip it is."""

    label: Translated
    gap_ms: int


class ShownClipRating(Declaration):
    """The declared single-clip rating as the page receives it."""

    kind: Literal["clip_rating"]
    scales: tuple[AnyScale, ...]
    arrangement: Literal["one_screen", "one_after_the_other"]
    check_scale: Points
    views: int
    reference: ShownRatingReference | None = None
    start: Literal["key", "fixation"]
    fixation_ms: int
    pointer_delay_ms: int
    confirm: bool
    comment: bool
    expected_seconds: float


def shown(experiment: Experiment) -> ShownClipRating:
    """Return the part of the declared trial that its page needs."""
    trial = clip_rating_of(experiment)
    reference = trial.reference
    return ShownClipRating(
        kind=trial.kind,
        scales=trial.asked_scales,
        arrangement=trial.arrangement,
        check_scale=trial.check_scale,
        views=trial.views,
        reference=reference and ShownRatingReference(label=reference.label, gap_ms=reference.gap_ms),
        start=trial.start,
        fixation_ms=trial.fixation_ms,
        pointer_delay_ms=trial.pointer_delay_ms,
        confirm=trial.confirm,
        comment=trial.comment,
        expected_seconds=trial.expected_seconds,
    )


# Who rates which clips in what order: everyone rates every clip, in blocks as declared.


def assign(experiment: Experiment, seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`; checks can require any point of the
    scale."""
    scale = clip_rating_of(experiment).check_scale

    def asked(rng: random.Random) -> int:
        return rng.randint(scale.minimum, scale.maximum)

    trials = single_clips(experiment, seed, slot, asked)
    reference = clip_rating_of(experiment).reference
    return (
        trials if reference is None else [_with_reference(reference, experiment, trial) for trial in trials]
    )


def check_choices(experiment: Experiment) -> int:
    """The points of the scale that attention checks can require."""
    scale = clip_rating_of(experiment).check_scale
    return scale.maximum - scale.minimum + 1


def _with_reference(reference: RatingReference, experiment: Experiment, trial: Trial) -> Trial:
    """The trial with its reference; checks have none."""
    if trial.clip is None or trial.check is not None:
        return trial
    return replace(trial, shown=(*trial.shown, Shown("reference", reference.of(experiment, trial.clip))))


def plan(experiment: Experiment) -> tuple[str, ...]:
    """Groups, how often each clip is seen, and which clip comes before it."""
    reference = clip_rating_of(experiment).reference
    return lines(experiment) if reference is None else (*lines(experiment), reference.said())


def block_size(experiment: Experiment, block: BlockSpec) -> int:
    """One trial per clip of the participant's share; the largest if blocks differ."""
    laps = len(experiment.assignment.lists) or 1
    seats = (seat_of(experiment, slot) for slot in range(laps))
    return max(len(share(experiment, seat).intersection(block.clips)) for seat in seats)


# One clip after another, each rated on a scale.

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "scale": "measured",
    "scales": "measured",
    "arrangement": "measured",
    "views": "measured",
    "reference": "measured",
    "reference.label": "wording",
    "start": "measured",
    "fixation_ms": "measured",
    "pointer_delay_ms": "wording",
    "confirm": "measured",
    "comment": "wording",
    "expected_seconds": "wording",
}

EXAMPLE = """\
[trial]
kind = "clip_rating"
start = "key"
expected_seconds = 7.2

[trial.scale]
minimum = 1
maximum = 7
question = { en = "How natural was this blink?" }
low = { en = "very unnatural" }
high = { en = "very natural" }
"""

FURTHER_EXAMPLES = (
    """\
[trial]
kind = "clip_rating"
arrangement = "one_screen"

[[trial.scales]]
name = "naturalness"
type = "points"
minimum = 1
maximum = 5
question = { en = "How natural was this blink?" }
labels = [
    { en = "not at all" },
    { en = "a little" },
    { en = "moderately" },
    { en = "rather" },
    { en = "very" },
]

[[trial.scales]]
name = "eeriness"
type = "slider"
minimum = 0.0
maximum = 100.0
step = 1.0
question = { en = "How eerie was it?" }
low = { en = "not at all" }
high = { en = "extremely" }
show_value = true
reverse = true
not_applicable = { en = "I cannot say" }
""",
    """\
[trial]
kind = "clip_rating"

[trial.scale]
minimum = 1
maximum = 5
question = { en = "How impaired is the second clip, compared with the first?" }
labels = [
    { en = "Very annoying" },
    { en = "Annoying" },
    { en = "Slightly annoying" },
    { en = "Perceptible, but not annoying" },
    { en = "Imperceptible" },
]

[trial.reference]
factor = "compression"
level = "none"
label = { en = "Reference" }
gap_ms = 2000
rate_itself = true
""",
    """\
[trial]
kind = "clip_rating"
scale = { type = "slider", question = { en = "Alike?" }, low = { en = "no" }, high = { en = "yes" } }
reference = { cell = "none/natural", label = { en = "Reference" } }
""",
)

CLIP_RATING = Kind(
    declaration=ClipRating,
    answer=RatingAnswer,
    view=RATINGS,
    roles=("shown",),
    effects=EFFECTS,
    page=ShownClipRating,
    shown=shown,
    assign=assign,
    block_size=block_size,
    plan=plan,
    fault=fault,
    shares_clips=True,
    groups=True,
    random_factors=True,
    example=EXAMPLE,
    further_examples=FURTHER_EXAMPLES,
    check_response=check_response,
    check_choices=check_choices,
)
