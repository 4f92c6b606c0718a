"""Which clips a participant sees, by the declared assignment, and how often each clip is seen in all."""

from collections import Counter
from typing import TYPE_CHECKING

from experiments import design
from experiments.assignment import lists
from experiments.assignment.every import every_clip
from experiments.assignment.groups import Place, clips_of, groups, place_of
from experiments.assignment.sample import sampled
from experiments.design import ClipSpec

if TYPE_CHECKING:
    from experiments.definition import Experiment


def share(experiment: "Experiment", place: Place) -> frozenset[ClipSpec]:
    """The clips that the participant at this place sees, once a repeat."""
    declared, clips = experiment.assignment, clips_of(experiment, place)
    if declared.lists:
        return lists.listed(clips, declared.lists, place.number)
    if declared.clips_per_cell is not None:
        of = experiment.exemplars
        return sampled(clips, declared.clips_per_cell, of.per_cell, of.seed, place.number)
    return every_clip(clips)


def expected_counts(experiment: "Experiment", participants: int) -> dict[ClipSpec, int]:
    """How often each clip is seen by this many participants, repeats of blocks included."""
    counts = Counter(
        clip for slot in range(participants) for clip in share(experiment, place_of(experiment, slot))
    )
    return {clip: counts[clip] * experiment.blocks.repeats for clip in design.clips(experiment)}


def lines(experiment: "Experiment") -> tuple[str, ...]:
    """What a plan says of it; nothing where everybody sees every clip."""
    every, people = groups(experiment), experiment.participants
    said: list[str] = []
    if len(every) > 1:
        sizes = Counter(place_of(experiment, slot).levels for slot in range(people))
        named = (f"{'/'.join(level for _, level in group)} ({sizes[group]})" for group in every)
        said.append(f"{len(every)} groups of participants in turn: {', '.join(named)}")
    if len(every) > 1 or experiment.assignment != type(experiment.assignment)():
        counts = expected_counts(experiment, people)
        low, high = min(counts.values()), max(counts.values())
        each = f"{low}" if low == high else f"{low} to {high}"
        said.append(f"with {people} participants each clip is seen {each} times")
        if unseen := [lists.label(clip) for clip, count in counts.items() if not count]:
            said.append(f"{len(unseen)} clips are seen by nobody, {unseen[0]} first")
    return tuple(said)


def fault(experiment: "Experiment") -> str | None:
    """What in the assignment does not fit the design, as `path: what to do`; None where all is well."""
    declared = experiment.assignment
    between = [factor.name for factor in experiment.factors if factor.between]
    if (declared.clips_per_cell or 0) > experiment.exemplars.per_cell:
        return (
            f"assignment.clips_per_cell: expected at most the {experiment.exemplars.per_cell} clips a cell "
            f"has, got {declared.clips_per_cell}"
        )
    if experiment.blocks.split_by in between:
        return (
            f"blocks.split_by: '{experiment.blocks.split_by}' differs between participants; "
            "split by a factor within them"
        )
    if declared.lists and between:
        return f"assignment.lists: '{between[0]}' already makes groups; leave out one of the two"
    wrong = lists.fault(design.clips(experiment), declared.lists)
    return f"assignment.lists: {wrong}" if wrong else None
