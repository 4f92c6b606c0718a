"""Balanced incomplete block designs: what balance means, counted from outside."""

from collections import Counter
from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.assignment.incomplete_blocks import balanced_blocks, near_sizes

# Blocks of designs in tables: Colbourn & Dinitz, Handbook of Combinatorial Designs (2007), II.1.
TABLED = [(7, 3, 7), (9, 3, 12), (13, 4, 13), (16, 4, 20), (15, 3, 35), (21, 5, 21), (25, 5, 30), (31, 6, 31)]
TABLED += [(6, 3, 10), (8, 4, 14), (10, 4, 15), (11, 5, 11), (12, 6, 22), (16, 6, 16), (64, 8, 72)]


@settings(max_examples=60, deadline=None)
@given(items=st.integers(2, 16), size=st.integers(2, 10))
def test_items_and_pairs_are_met_equally_often(items: int, size: int) -> None:
    blocks = balanced_blocks(items, size)
    if blocks is None:
        assert size > items or items >= 14
        return
    assert all(len(set(block)) == size and set(block) <= set(range(items)) for block in blocks)
    pairs = Counter(pair for block in blocks for pair in combinations(block, 2))
    met = Counter(item for block in blocks for item in block)
    assert set(pairs) == set(combinations(range(items), 2))
    assert len(set(pairs.values())) == len(set(met.values())) == 1


@pytest.mark.parametrize(("items", "size", "number"), TABLED)
def test_designs_of_the_tables_are_found_and_no_much_larger_ones(items: int, size: int, number: int) -> None:
    blocks = balanced_blocks(items, size)
    assert blocks is not None
    assert len(blocks) % number == 0
    assert len(blocks) <= 2 * number


@settings(max_examples=30, deadline=None)
@given(st.sampled_from([(7, 3), (9, 3), (13, 4), (16, 4), (15, 3), (21, 5)]), st.data())
def test_where_a_round_has_each_pair_once_any_part_of_it_is_within_one(
    design: tuple[int, int], data: st.DataObject
) -> None:
    blocks = balanced_blocks(*design)
    assert blocks is not None
    people = data.draw(st.integers(1, len(blocks)))
    pairs = Counter(pair for block in blocks[:people] for pair in combinations(block, 2))
    assert max(pairs.values()) == 1


def test_a_design_that_is_not_known_is_none_and_near_ones_are_named() -> None:
    assert balanced_blocks(3, 4) is None
    assert balanced_blocks(40, 9) is None
    assert near_sizes(16, 5) == [size for size in (3, 4, 5, 6, 7) if balanced_blocks(16, size)]
    assert 4 in near_sizes(16, 5)
