"""Which levels of the random factors a participant sees, where they see some of them only."""

import random
from collections.abc import Iterable, Mapping, Sequence
from math import gcd, lcm, prod
from typing import TYPE_CHECKING

from experiments.assignment.block_orders import block_orders
from experiments.assignment.incomplete_blocks import balanced_blocks, near_sizes

if TYPE_CHECKING:
    from experiments.definition import Experiment
    from experiments.definition.factors import Factor

Seen = Mapping[str, frozenset[str]]
"""The levels that a participant sees, by factor; factors of which all are seen are not in it."""


def seen_levels(experiment: "Experiment", seat: int) -> Seen:
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


def exemplar_turn(experiment: "Experiment", seat: int, per_cell: int) -> int:
    """The turn by which exemplars are dealt to a seat, so that all of them meet all dealt levels."""
    cycles = [len(_subsets(f, experiment.exemplars.seed)) for f in experiment.factors if f.dealt]
    if not cycles:
        return seat
    exemplars = experiment.exemplars.per_cell
    orders = len(block_orders(experiment))
    return turn_of_last(seat, [orders, *cycles, exemplars // gcd(exemplars, per_cell)])


def sees(seen: Seen, levels: Iterable[tuple[str, str]]) -> bool:
    """Whether a cell has none but seen levels."""
    return all(level in seen[factor] for factor, level in levels if factor in seen)


def fault(experiment: "Experiment") -> str | None:
    """What does not fit of the dealt factors, as `path: what to do`; None where all is well."""
    dealt = [factor for factor in experiment.factors if factor.dealt]
    if dealt and experiment.assignment.lists:
        return f"assignment.lists: '{dealt[0].name}' is dealt by per_participant; leave out one of the two"
    for factor in dealt:
        if experiment.blocks.split_by == factor.name:
            return f"blocks.split_by: participants see some levels of '{factor.name}' only; split by another"
        number, size = len(factor.levels), factor.per_participant or 1
        if size > 1 and balanced_blocks(number, size) is None:
            near = " or ".join(map(str, near_sizes(number, size))) or "1"
            return (
                f"factors: '{factor.name}': no balanced way to show {size} of {number} levels is known; "
                f"set per_participant = {near}"
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


def _subsets(factor: "Factor", seed: int) -> list[frozenset[str]]:
    names, size = [level.name for level in factor.levels], factor.per_participant or 1
    random.Random(f"{seed}/{factor.name}").shuffle(names)
    blocks = [(k,) for k in range(len(names))] if size == 1 else balanced_blocks(len(names), size)
    return [frozenset(names[k] for k in block) for block in blocks or ()]
