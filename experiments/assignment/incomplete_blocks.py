"""Balanced incomplete block designs: blocks of k of v items in which any two items meet equally often.

Written (v, b, r, k, lambda): b blocks, each item in r of them, any two items together in lambda. Two
identities hold (Fisher 1940; Stinson, Combinatorial Designs, 2004, theorems 1.8 and 1.9):

    b k = v r                                                                              (1)
    lambda (v - 1) = r (k - 1)                                                             (2)

Designs are found by differences (Bose 1939): base blocks are developed by adding 1, 2, ... modulo n, over the
residues alone (n = v) or with one more item that stays fixed (n = v - 1). Every difference must then occur
lambda times within the base blocks. Where the search finds none, all blocks of k items serve as long as
they are few.
"""

import random
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations, islice, permutations
from math import comb

from experiments.declaration.experiment import Experiment

MAX_BLOCKS = 2_000
MAX_LAMBDA = 12
MAX_STEPS, MAX_STEPS_IN_ALL = 10_000, 100_000
"""Points tried in one search, and in all for one design, so that a hopeless one ends within a second."""
MAX_EVENED = 200

Block = tuple[int, ...]


@lru_cache(maxsize=256)
def balanced_blocks(items: int, size: int) -> tuple[Block, ...] | None:
    """The blocks of a balanced incomplete design; None where none is known here.

    Parameters
    ----------
    items : int
        How many there are (v), called 0 to `items` - 1 in the blocks.
    size : int
        Items in a block (k), 2 or more.

    Returns
    -------
    The blocks, each in rising order, ordered so that items and pairs of items are met evenly from the start.

    Examples
    --------
    >>> balanced_blocks(7, 3)[:2]
    ((0, 1, 3), (0, 2, 6))
    >>> balanced_blocks(5, 6) is None
    True
    """
    if not 2 <= size <= items:
        return None
    if size == items:
        return (tuple(range(items)),)
    blocks = _complement(items, size) if 2 * size > items else _by_differences(items, size)
    if blocks is None and comb(items, size) <= MAX_BLOCKS:
        blocks = list(combinations(range(items), size))
    return None if blocks is None else _evened(blocks)


def near_sizes(items: int, size: int) -> list[int]:
    """The block sizes next to `size` for which a design of so many items is known here."""
    near = range(max(2, size - 2), min(items, size + 2) + 1)
    return [other for other in near if balanced_blocks(items, other) is not None]


def _complement(items: int, size: int) -> list[Block] | None:
    """What the blocks of a design leave out makes a design too."""
    left_out = items - size
    if left_out == 1:
        return list(combinations(range(items), size))
    small = balanced_blocks(items, left_out)
    every = set(range(items))
    return [tuple(sorted(every.difference(block))) for block in small or ()] or None


def _by_differences(items: int, size: int) -> list[Block] | None:
    if size == 2 and comb(items, 2) <= MAX_BLOCKS:
        return list(combinations(range(items), 2))
    left = MAX_STEPS_IN_ALL
    for times in range(1, MAX_LAMBDA + 1):
        blocks, rest = divmod(times * items * (items - 1), size * (size - 1))
        if rest or (times * (items - 1)) % (size - 1) or blocks < items:
            continue  # no design has these numbers, by (1), (2) and Fisher's inequality b >= v
        if blocks > MAX_BLOCKS:
            return None
        for fixed in (False, True):
            search = _Search(items - fixed, size, times, fixed, min(left, MAX_STEPS))
            developed = search.blocks()
            if developed is not None:
                return developed
            left -= min(left, MAX_STEPS) - search.steps
    return None


class _Search:
    """Base blocks modulo n whose differences all occur `times` times; `fixed` adds an item that is not moved.

    A base block that is a subgroup (or the fixed item with one) repeats before n steps: a short orbit.

    Attributes
    ----------
    steps : int
        How many points may be tried; counted down.
    """

    def __init__(self, n: int, size: int, times: int, fixed: bool, steps: int) -> None:
        self.n, self.size, self.times, self.fixed = n, size, times, fixed
        self.steps = steps
        # Differences d and n - d are one; half of n is met from both ends of a pair, so it counts double.
        self._met = [0] * (n // 2 + 1)

    def blocks(self) -> list[Block] | None:
        """The developed blocks; None where the search finds none in its steps."""
        for short, full in self._fixed_parts():
            self._met = [0] * (self.n // 2 + 1)
            group = self._subgroup()
            for _ in range(short):
                for member in group[1:]:
                    self._met[min(member, self.n - member)] += 1
            # Each such difference was entered from both sides of the subgroup.
            self._met = [count // 2 if 2 * d != self.n else count for d, count in enumerate(self._met)]
            if max(self._met) > self.times:
                continue
            bases = self._extend([], full)
            if bases is not None:
                return self._developed(bases) + self._short_blocks(group) * short
        return None

    def _fixed_parts(self) -> Iterator[tuple[int, int]]:
        """How many short orbits, and how many full base blocks hold the fixed item."""
        points = self.size - self.fixed
        most_short = self.times if self.n % points == 0 and points > 1 else 0
        for short in range(most_short + 1):
            if not self.fixed:
                yield short, 0
            else:
                full, rest = divmod(self.times - short, self.size - 1)
                if not rest:
                    yield short, full

    def _subgroup(self) -> list[int]:
        points = self.size - self.fixed
        return list(range(0, self.n, self.n // points)) if self.n % points == 0 else [0]

    def _short_blocks(self, group: list[int]) -> list[Block]:
        more = (self.n,) if self.fixed else ()
        return [
            tuple(sorted((start + x) % self.n for x in group)) + more for start in range(self.n // len(group))
        ]

    def _extend(self, bases: list[Block], with_fixed: int) -> list[Block] | None:
        """Add base blocks until every difference is met; depth first, the least met difference next."""
        missing = [d for d in range(1, self.n // 2 + 1) if self._met[d] < self.times]
        if not missing:
            return bases if not with_fixed else None
        if with_fixed == 0 and self._left() < self.size * (self.size - 1) // 2:
            return None
        least = missing[0]
        size = self.size - 1 if with_fixed else self.size
        if not self._enter(0, (least,)):
            return None
        for block in self._grown((0, least), size):
            deeper = self._extend([*bases, (*block, self.n) if with_fixed else block], max(with_fixed - 1, 0))
            if deeper is not None:
                return deeper
        self._leave(0, (least,))
        return None

    def _left(self) -> int:
        return sum(self.times - count for count in self._met[1:])

    def _grown(self, block: Block, size: int) -> Iterator[Block]:
        """Every block that begins so and meets no difference too often; it is entered while it lasts."""
        if len(block) == size:
            yield block
            return
        if len(block) > size:
            return
        for new in range(block[-1] + 1 if len(block) > 2 else 1, self.n):
            if new in block or self.steps <= 0:
                continue
            self.steps -= 1
            if self._enter(new, block):
                yield from self._grown((*block, new), size)
                self._leave(new, block)

    def _enter(self, new: int, block: Block) -> bool:
        for position, old in enumerate(block):
            if not self._count(new - old, 1):
                self._leave(new, block[:position])
                return False
        return True

    def _count(self, difference: int, by: int) -> bool:
        """Count a difference; False, and nothing counted, where it would be met too often."""
        d = min(difference % self.n, -difference % self.n)
        by *= 2 if 2 * d == self.n else 1
        if self._met[d] + by > self.times:
            return False
        self._met[d] += by
        return True

    def _leave(self, new: int, block: Block) -> None:
        for old in block:
            self._count(new - old, -1)

    def _developed(self, bases: list[Block]) -> list[Block]:
        return [
            tuple(sorted((x + step) % self.n if x < self.n else x for x in base))
            for step in range(self.n)
            for base in bases
        ]


def _evened(blocks: list[Block]) -> tuple[Block, ...]:
    """The blocks in an order in which pairs, then items, are met as evenly as a greedy choice makes it.

    Very many blocks are shuffled, always alike.
    """
    left = sorted(blocks)
    if len(left) > MAX_EVENED:
        random.Random(len(left)).shuffle(left)
        return tuple(left)
    pairs, items = Counter[tuple[int, int]](), Counter[int]()
    order: list[Block] = []
    while left:
        best = min(
            left,
            key=lambda block: (
                sum(pairs[two] for two in combinations(block, 2)),
                sum(items[x] for x in block),
            ),
        )
        left.remove(best)
        order.append(best)
        pairs.update(combinations(best, 2))
        items.update(best)
    return tuple(order)


# The orders of blocks that participants are dealt in turn.

MAX_ORDERS = 120
"""Up to five blocks every order is dealt; beyond that a Latin square: each block in each place."""


def block_orders(experiment: Experiment) -> list[tuple[int, ...]]:
    """The orders of the levels' blocks that slots are dealt, as indices; one where nothing is dealt."""
    split = experiment.blocks.split_by
    count = len(experiment.factor(split).levels) if split else 1
    if experiment.blocks.order == "alternating":
        return [tuple((start + step) % count for step in range(count)) for start in range(count)]
    if experiment.blocks.order == "counterbalanced":
        every = list(islice(permutations(range(count)), MAX_ORDERS + 1))
        return every if len(every) <= MAX_ORDERS else _latin_square(count)
    return [tuple(range(count))]


def _latin_square(count: int) -> list[tuple[int, ...]]:
    """Williams' balanced square (1949): each block in each place, and after each other equally often."""
    first = [0]
    for step in range(1, count):
        first.append((step + 1) // 2 if step % 2 else count - step // 2)
    rows = [tuple((index + shift) % count for index in first) for shift in range(count)]
    return rows if count % 2 == 0 else rows + [tuple(reversed(row)) for row in rows]
