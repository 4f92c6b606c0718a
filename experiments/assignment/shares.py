"""Which clips a participant sees, by the declared assignment, and how often each clip is seen in all."""

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from experiments import design
from experiments.assignment import levels, lists
from experiments.assignment.every import every_clip
from experiments.assignment.groups import Seat, clips_of, groups, name_of, names, seat_of
from experiments.assignment.sample import sampled
from experiments.trials.declared import ClipSpec

if TYPE_CHECKING:
    from experiments.definition import Experiment


def share(experiment: "Experiment", seat: Seat) -> frozenset[ClipSpec]:
    """The clips that the participant at this place is asked about, once a repeat."""
    seen = levels.seen_levels(experiment, seat.number)
    declared, rates = experiment.assignment, experiment.trial.rates
    own = (clip for clip in clips_of(experiment, seat) if rates(experiment, clip))
    clips = [clip for clip in own if levels.sees(seen, clip.levels)]
    if declared.lists:
        return lists.listed(clips, declared.lists, seat.number)
    if declared.clips_per_cell is not None:
        of = experiment.exemplars
        turn = levels.exemplar_turn(experiment, seat.number, declared.clips_per_cell)
        return sampled(clips, declared.clips_per_cell, of.per_cell, of.seed, turn)
    return every_clip(clips)


def expected_slots(experiment: "Experiment") -> list[int]:
    """The slots that will be held: those of full quotas where every group has one, else the first ones."""
    every, quotas = names(experiment), experiment.groups.quotas
    if len(every) > 1 and set(quotas) == set(every):
        return [
            turn + len(every) * number for turn, name in enumerate(every) for number in range(quotas[name])
        ]
    return list(range(experiment.participants))


def expected_counts(experiment: "Experiment", slots: Iterable[int]) -> dict[ClipSpec, int]:
    """How often each clip is seen by the participants with these slots, repeats of blocks included."""
    counts = Counter(clip for slot in slots for clip in share(experiment, seat_of(experiment, slot)))
    return {clip: counts[clip] * experiment.blocks.repeats for clip in design.rated_clips(experiment)}


def lines(experiment: "Experiment") -> tuple[str, ...]:
    """What a plan says of it; nothing where everybody sees every clip."""
    every, slots = groups(experiment), expected_slots(experiment)
    said: list[str] = [said_of_groups(experiment)] if len(every) > 1 else []
    for factor in experiment.factors:
        if factor.dealt:
            number = len(factor.levels)
            said.append(
                f"each participant sees {factor.per_participant} of {number} levels of '{factor.name}'"
            )
    if len(every) > 1 or said or experiment.assignment != type(experiment.assignment)():
        counts = expected_counts(experiment, slots)
        low, high = min(counts.values()), max(counts.values())
        each = f"{low}" if low == high else f"{low} to {high}"
        said.append(f"with {len(slots)} participants each clip is seen {each} times")
        if unseen := [lists.label(clip) for clip, count in counts.items() if not count]:
            said.append(f"{len(unseen)} clips are seen by nobody, {unseen[0]} first")
    return tuple(said)


def said_of_groups(experiment: "Experiment") -> str:
    """The groups, how participants come into them, and their sizes, in one line of a plan."""
    declared, named = experiment.groups, names(experiment)
    ways = {"turn": "in turn", "link": "by link"}
    way = ways.get(declared.by) or f"by the answer to '{declared.question}'"
    sizes = {name: str(declared.quotas.get(name, "no quota")) for name in named}
    if not declared.quotas and declared.by == "turn":
        turns = Counter(name_of(seat_of(experiment, slot).levels) for slot in expected_slots(experiment))
        sizes = {name: str(turns[name]) for name in named}
    listed = (f"{name} ({size})" for name, size in sizes.items())
    return f"{len(named)} groups of participants {way}: {', '.join(listed)}"


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
    if wrong := levels.fault(experiment):
        return wrong
    wrong = lists.fault(design.rated_clips(experiment), declared.lists)
    return f"assignment.lists: {wrong}" if wrong else None
