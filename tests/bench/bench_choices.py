"""What the server's choices cost: pairs chosen by what is stored, and the next stimulus of a series.

Beside them, in the same run: pairs dealt by a fixed design, and a series over one factor beside one over two.
Part of `make bench`; alone: pytest tests/bench/bench_choices.py -o python_files='bench_*.py' -s
"""

import random
import sys
import time
from collections.abc import Callable
from itertools import combinations

from experiments import design
from experiments.kinds.pair_choice import Stored, batch
from experiments.kinds.paired_comparison import assign
from experiments.kinds.threshold_grid import Model, model
from experiments.load import load_experiment
from server.participation import quest

ITEMS, ANSWERS, PAIRS = 20, 2_000, 24
TRIALS = 30


def cpu_ms(work: Callable[[], object], times: int = 20) -> float:
    """Median processor time of some runs."""
    taken = []
    for _ in range(times):
        begun = time.process_time()
        work()
        taken.append(1000 * (time.process_time() - begun))
    return sorted(taken)[times // 2]


def say(name: str, ms: float, beside: str, baseline_ms: float) -> None:
    sys.stdout.write(f"\n{name}: {ms:.2f} ms; {beside}: {baseline_ms:.2f} ms; ratio {ms / baseline_ms:.2f}\n")


def test_pairs_chosen_when_a_run_starts(benchmark) -> None:
    rng = random.Random(1)
    edges = list(combinations(range(ITEMS), 2))
    stored = {edge: Stored() for edge in edges}
    for _ in range(ANSWERS):
        one = stored[rng.choice(edges)]
        one.answered += 1
        one.won += rng.random() < 0.6
    demo = load_experiment("pairs-demo")
    assert len(design.clips(demo)) == 8
    chosen = cpu_ms(lambda: batch(ITEMS, edges, stored, PAIRS, random.Random(2)))
    dealt = cpu_ms(lambda: assign(demo, 1, 0))
    say(f"{PAIRS} pairs of {ITEMS} items chosen by {ANSWERS} answers", chosen, "12 pairs dealt", dealt)
    benchmark(lambda: batch(ITEMS, edges, stored, PAIRS, random.Random(2)))


def cost_of_an_answer_ms(assumed: Model, ahead: int) -> float:
    """Of each answer of a new series: the estimate after it, and the next stimuli."""
    rng, said, taken = random.Random(3), (), []
    for _ in range(TRIALS):
        stimulus = quest.choices(assumed, said, 1)[0]
        said = (*said, (stimulus, rng.random() < 0.5))
        begun = time.process_time()
        quest.estimate(assumed, said)
        quest.choices(assumed, said, ahead)
        taken.append(1000 * (time.process_time() - begun))
    return sorted(taken)[TRIALS // 2]


def test_an_answer_of_a_series(benchmark) -> None:
    cost = {}
    for name in ("threshold-demo", "plane-demo"):
        demo = load_experiment(name)
        quest.choices(model(demo), (), 1)  # what is reckoned once for all series
        cost[name] = cost_of_an_answer_ms(model(demo), 1 + demo.trial.ahead)
    say(
        "an answer of plane-demo, 4 stimuli chosen",
        cost["plane-demo"],
        "of threshold-demo",
        cost["threshold-demo"],
    )
    assumed = model(load_experiment("threshold-demo"))
    benchmark(lambda: quest.choices(assumed, (), 1))
