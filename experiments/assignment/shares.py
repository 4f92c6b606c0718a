"""Which clips a participant sees, by the declared assignment: every clip, samples, lists or some levels."""

import random
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import gcd, lcm, prod

from experiments import design
from experiments.assignment.groups import Seat, clips_of, groups, name_of, names, seat_of
from experiments.assignment.incomplete_blocks import balanced_blocks, block_orders, near_sizes
from experiments.declaration.experiment import Experiment
from experiments.declaration.factors import Factor
from experiments.declaration.trial import ClipSpec
from experiments.errors import did_you_mean

# Every clip for everybody.


# Decision 0715: Faces as random items.
def every_clip(clips: Sequence[ClipSpec]) -> frozenset[ClipSpec]:
    """All of `clips`, those of the participant's group."""
    return frozenset(clips)


# Declared lists of clips, assigned to participants in turn.


def list_label(clip: ClipSpec) -> str:
    """A clip as lists write it: its cell and its exemplar, joined by a slash."""
    return f"{clip.cell}/{clip.exemplar}"


def listed_clips(
    clips: Sequence[ClipSpec], lists: Sequence[Sequence[str]], number: int
) -> frozenset[ClipSpec]:
    """The clips of the list that falls to this place."""
    mine = set(lists[number % len(lists)])
    return frozenset(clip for clip in clips if list_label(clip) in mine)


def fault_of_lists(clips: Sequence[ClipSpec], lists: Sequence[Sequence[str]]) -> str | None:
    """The first clip in `lists` that the design does not have; None where there is none."""
    known = [list_label(clip) for clip in clips]
    for number, listed in enumerate(lists, start=1):
        for name in listed:
            if name not in known:
                return f"list {number}: the design has no clip '{name}'{did_you_mean(name, known)}"
    return None


# A balanced sample of each cell's clips for each participant.


def sampled_clips(
    clips: Sequence[ClipSpec], per_cell: int, exemplars: int, seed: int, number: int
) -> frozenset[ClipSpec]:
    """The clips that one participant sees.

    Parameters
    ----------
    clips : sequence of ClipSpec
        Of the participant's group, all exemplars of each cell.
    per_cell : int
        How many of each cell's exemplars are seen.
    exemplars : int
        How many there are.
    seed : int
        Of the order in which exemplars are dealt, the same for all participants.
    number : int
        Of the participant in the group, from 0. Exemplars are dealt around a circle, so that over the first N
        places, for any N, how often two clips are seen differs by at most one.
    """
    order = list(range(1, exemplars + 1))
    random.Random(seed).shuffle(order)
    mine = {order[(number * per_cell + step) % exemplars] for step in range(per_cell)}
    return frozenset(clip for clip in clips if clip.exemplar in mine)


# Which levels of the random factors a participant sees, where they see some of them only.

Seen = Mapping[str, frozenset[str]]
"""The levels that a participant sees, by factor; factors of which all are seen are not in it."""


def seen_levels(experiment: Experiment, seat: int) -> Seen:
    """The levels that the participant at this seat (from 0, in their group) sees of each dealt factor.

    Any two levels are seen together equally often: a balanced incomplete block design, dealt in turn. The
    levels of several factors, and the orders of blocks, meet in every combination equally often.
    """
    seen: dict[str, frozenset[str]] = {}
    cycles = [len(block_orders(experiment))]
    for factor in experiment.factors:
        if factor.dealt:
            subsets = _subsets(factor, experiment.exemplars.seed)
            cycles.append(len(subsets))
            seen[factor.name] = subsets[turn_of_last(seat, cycles) % len(subsets)]
    return seen


def exemplar_turn(experiment: Experiment, seat: int, per_cell: int) -> int:
    """The turn by which exemplars are dealt to a seat, so that all of them meet all dealt levels."""
    cycles = [len(_subsets(f, experiment.exemplars.seed)) for f in experiment.factors if f.dealt]
    if not cycles:
        return seat
    exemplars = experiment.exemplars.per_cell
    orders = len(block_orders(experiment))
    return turn_of_last(seat, [orders, *cycles, exemplars // gcd(exemplars, per_cell)])


def sees_levels(seen: Seen, levels: Iterable[tuple[str, str]]) -> bool:
    """Whether a cell has none but seen levels."""
    return all(level in seen[factor] for factor, level in levels if factor in seen)


def fault_of_levels(experiment: Experiment) -> str | None:
    """What does not fit of the dealt factors, as `path: what to do`; None where all is well."""
    dealt = [factor for factor in experiment.factors if factor.dealt]
    if dealt and experiment.assignment.lists:
        return (
            f"assignment.lists: '{dealt[0].name}' is already assigned by per_participant; remove one of "
            f"the two"
        )
    for factor in dealt:
        if experiment.blocks.split_by == factor.name:
            return (
                f"blocks.split_by: participants see only some levels of '{factor.name}'; split by "
                f"another factor"
            )
        number, size = len(factor.levels), factor.per_participant or 1
        if size > 1 and balanced_blocks(number, size) is None:
            near = " or ".join(map(str, near_sizes(number, size))) or "1"
            return (
                f"factors: '{factor.name}': there is no known balanced design for {size} of {number} "
                f"levels; set per_participant = {near}"
            )
    return None


def turn_of_last(seat: int, cycles: Sequence[int]) -> int:
    """The turn, at a seat, of the last of several cycles that are dealt side by side.

    t_k = s + floor(s / lcm(P, c)) mod gcd(P, c), P = c_1 ... c_{k-1}, c = c_k      (1)

    with s the seat and c_i the lengths of the cycles. Cycles with a common divisor would always meet in the
    same pairs; each is shifted by one whenever it has been through together with all combinations of those
    before it. By induction over k, P c seats in a row hold every combination of the k turns once: s modulo
    lcm(P, c) runs through those with s = s' modulo gcd(P, c), and the shifts through the rest.
    """
    *before, last = cycles
    combinations = prod(before)
    return seat + seat // lcm(combinations, last) % gcd(combinations, last)


def _subsets(factor: Factor, seed: int) -> list[frozenset[str]]:
    names, size = [level.name for level in factor.levels], factor.per_participant or 1
    random.Random(f"{seed}/{factor.name}").shuffle(names)
    blocks = [(k,) for k in range(len(names))] if size == 1 else balanced_blocks(len(names), size)
    return [frozenset(names[k] for k in block) for block in blocks or ()]


# Which clips a participant sees, by the declared assignment, and how often each clip is seen in all.


def share(experiment: Experiment, seat: Seat) -> frozenset[ClipSpec]:
    """The clips that the participant at this place is asked about, once a repeat."""
    seen = seen_levels(experiment, seat.number)
    declared, rates = experiment.assignment, experiment.trial.rates
    own = (clip for clip in clips_of(experiment, seat) if rates(experiment, clip))
    clips = [clip for clip in own if sees_levels(seen, clip.levels)]
    if declared.lists:
        return listed_clips(clips, declared.lists, seat.number)
    if declared.clips_per_cell is not None:
        of = experiment.exemplars
        turn = exemplar_turn(experiment, seat.number, declared.clips_per_cell)
        return sampled_clips(clips, declared.clips_per_cell, of.per_cell, of.seed, turn)
    return every_clip(clips)


def expected_slots(experiment: Experiment) -> list[int]:
    """The slots that will be held: those of full quotas where every group has one, else the first ones."""
    every, quotas = names(experiment), experiment.groups.quotas
    if len(every) > 1 and set(quotas) == set(every):
        return [
            turn + len(every) * number for turn, name in enumerate(every) for number in range(quotas[name])
        ]
    return list(range(experiment.participants))


def expected_counts(experiment: Experiment, slots: Iterable[int]) -> dict[ClipSpec, int]:
    """How often each clip is seen by the participants with these slots, repeats of blocks included."""
    counts = Counter(clip for slot in slots for clip in share(experiment, seat_of(experiment, slot)))
    return {clip: counts[clip] * experiment.blocks.repeats for clip in design.rated_clips(experiment)}


def lines(experiment: Experiment) -> tuple[str, ...]:
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
        said.append(f"with {len(slots)} participants, each clip is seen {each} times")
        if unseen := [list_label(clip) for clip, count in counts.items() if not count]:
            said.append(f"{len(unseen)} clips are never shown, such as {unseen[0]}")
    return tuple(said)


def said_of_groups(experiment: Experiment) -> str:
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


def fault_of_assignment(experiment: Experiment) -> str | None:
    """What in the assignment does not fit the design, as `path: what to do`; None where all is well."""
    declared = experiment.assignment
    between = [factor.name for factor in experiment.factors if factor.between]
    if (declared.clips_per_cell or 0) > experiment.exemplars.per_cell:
        return (
            f"assignment.clips_per_cell: expected at most {experiment.exemplars.per_cell}, the number of "
            f"clips per cell; got {declared.clips_per_cell}"
        )
    if experiment.blocks.split_by in between:
        return (
            f"blocks.split_by: '{experiment.blocks.split_by}' differs between participants; split by a "
            f"within-participant factor"
        )
    if declared.lists and between:
        return f"assignment.lists: '{between[0]}' already makes groups; remove one of the two"
    if wrong := fault_of_levels(experiment):
        return wrong
    wrong = fault_of_lists(design.rated_clips(experiment), declared.lists)
    return f"assignment.lists: {wrong}" if wrong else None
