"""The timings of calculations: the ANOVA, the server's choices, the blink engine.

Part of `make bench`; alone: python -m pytest bench/bench_calculations.py -o python_files='bench_*.py' -s
"""

import random
import sys
import time
import warnings
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from analysis.pairs.abilities import fit_abilities
from analysis.pairs.comparisons import read_comparisons
from analysis.plans.clip_rating import READING, analyse_study
from analysis.read.database import load_database
from analysis.read.study_answers import load_csv
from analysis.report.within_tables import all_tables
from analysis.within.anova import within_anova
from analysis.within.cell_means import cell_table
from bench.harness import cpu_times_s
from blink_engine import BlinkEngine, perform
from experiments import design
from experiments.kinds.pair_choice import StoredComparisons, batch
from experiments.kinds.paired_comparison import assign
from experiments.kinds.threshold_grid import Model, model
from experiments.load import load_experiment
from server.participation import quest
from tests.analysis.ratings_file import rows_of, simulate, write_export
from tests.analysis.study_database import make_database

EXP1, EXP2 = load_experiment("exp1"), load_experiment("exp2")


@pytest.fixture(scope="module")
def rows(tmp_path_factory) -> pd.DataFrame:
    path = tmp_path_factory.mktemp("bench") / "exp1.csv"
    write_export(path, EXP1, rows_of(EXP1, simulate(EXP1, 32, trials=20)))
    return load_csv(path, EXP1, READING).rows


def all_tests(rows: pd.DataFrame):
    table = cell_table(rows, "participant", "response", EXP1.factor_names)
    return within_anova(table.y, table.factors, table.levels)


def test_fifteen_tests_from_10240_rows(benchmark, rows) -> None:
    """Target: under 10 ms."""
    assert len(rows) == 10_240
    assert len(benchmark(all_tests, rows).effects) == 15


def test_ratio_to_statsmodels(benchmark, rows) -> None:
    """Aim: a thousand times as fast as AnovaRM on the same rows."""
    from statsmodels.stats.anova import AnovaRM

    frame = rows.astype(dict.fromkeys((*EXP1.factor_names, "participant"), str))

    def theirs() -> None:
        AnovaRM(frame, "response", "participant", within=list(EXP1.factor_names), aggregate_func="mean").fit()

    ours = min(_seconds(lambda: all_tests(rows)) for _ in range(20))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        benchmark.pedantic(theirs, rounds=3, iterations=1, warmup_rounds=1)
    best = benchmark.stats.stats.min
    sys.stdout.write(f"\nours {ours * 1e3:.2f} ms, AnovaRM {best * 1e3:.0f} ms, ratio {best / ours:.0f}\n")


def test_a_million_ratings_from_sql_to_tables(benchmark, tmp_path) -> None:
    """Target: under 10 s."""
    n = 2500
    random = np.random.default_rng(1)
    ratings = np.clip(np.rint(random.normal(4.3, 1.3, (n, 5, 4, 2, 10))), 1, 7).astype(int)
    url = make_database(tmp_path / "m.sqlite", EXP2, ratings, participants=[f"P{i:05d}" for i in range(n)])
    start = time.process_time()
    tables = benchmark.pedantic(
        lambda: all_tables(analyse_study(EXP2, load_database(url, EXP2, READING))), rounds=1, iterations=1
    )
    cpu = time.process_time() - start
    assert len(tables) >= 6
    wall = benchmark.stats.stats.min
    sys.stdout.write(f"\n1,000,000 ratings from SQL to tables: {wall:.1f} s, {cpu:.1f} s of processor time\n")


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


ITEMS, ANSWERS, PAIRS = 20, 2_000, 24
TRIALS = 30


def cpu_ms(work: Callable[[], object], times: int = 20) -> float:
    """Median processor time of some runs."""
    return 1000 * sorted(cpu_times_s(work, times))[times // 2]


def say_ratio(name: str, ms: float, beside: str, baseline_ms: float) -> None:
    sys.stdout.write(f"\n{name}: {ms:.2f} ms; {beside}: {baseline_ms:.2f} ms; ratio {ms / baseline_ms:.2f}\n")


def test_pairs_chosen_when_a_run_starts(benchmark) -> None:
    rng = random.Random(1)
    edges = list(combinations(range(ITEMS), 2))
    stored = {edge: StoredComparisons() for edge in edges}
    for _ in range(ANSWERS):
        one = stored[rng.choice(edges)]
        one.answered += 1
        one.won += rng.random() < 0.6
    demo = load_experiment("pairs-demo")
    assert len(design.clips(demo)) == 8
    chosen = cpu_ms(lambda: batch(ITEMS, edges, stored, PAIRS, random.Random(2)))
    dealt = cpu_ms(lambda: assign(demo, 1, 0))
    say_ratio(f"{PAIRS} pairs of {ITEMS} items chosen by {ANSWERS} answers", chosen, "12 pairs dealt", dealt)
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
        quest.choices(model(demo), (), 1)  # what is computed once for all series
        cost[name] = cost_of_an_answer_ms(model(demo), 1 + demo.trial.ahead)
    say_ratio(
        "an answer of plane-demo, 4 stimuli chosen",
        cost["plane-demo"],
        "of threshold-demo",
        cost["threshold-demo"],
    )
    assumed = model(load_experiment("threshold-demo"))
    benchmark(lambda: quest.choices(assumed, (), 1))


FPS, SECONDS = 60.0, 3600.0
FRAMES = round(FPS * SECONDS)
MUST_PER_S = 1e6


def least_cpu_s(work: Callable[[], object]) -> float:
    """Least processor time of three runs."""
    return min(cpu_times_s(work, 3))


def test_an_hour_at_once_and_frame_by_frame(benchmark):
    at_once = least_cpu_s(lambda: perform(SECONDS, FPS, seed=3, state="speaking"))
    moments = np.arange(FRAMES) / FPS
    baseline = least_cpu_s(lambda: np.abs(np.sin(moments)) ** 1.19)

    def one_by_one() -> None:
        engine = BlinkEngine(seed=3, state="speaking")
        for time_s in moments[:36_000].tolist():
            engine.frame(time_s)

    frame_us = least_cpu_s(one_by_one) / 36_000 * 1e6
    sys.stdout.write(
        f"\nblink engine: {FRAMES / at_once / 1e6:.1f} million frames/s at once (must {MUST_PER_S / 1e6:g}), "
        f"{at_once / baseline:.1f} times a sine and a power of as many numbers; {frame_us:.1f} us per frame "
        "one by one\n"
    )
    benchmark.extra_info["times_baseline"] = at_once / baseline
    benchmark.pedantic(lambda: perform(60.0, FPS, seed=3), rounds=5, iterations=1)


def test_a_million_paired_comparisons(benchmark, tmp_path) -> None:
    """Target: under 5 s of processor time, raters as clusters; next to reading the file by pandas."""
    rng, n, items = np.random.default_rng(1), 1_000_000, 20
    names = np.array([f"i{k:02d}" for k in range(items)])
    left = rng.integers(items, size=n)
    right = (left + rng.integers(1, items, size=n)) % items
    winner = np.where(rng.random(n) < 1 / (1 + np.exp((right - left) / 10)), "left", "right")
    raters = np.char.add("p", rng.integers(500, size=n).astype(str))
    path = tmp_path / "pairs.csv"
    columns = {"left": names[left], "right": names[right], "winner": winner, "rater": raters}
    pd.DataFrame(columns).to_csv(path, index=False)
    start = time.process_time()
    comparisons = read_comparisons(path, "left", "right", "winner", None, "rater")
    read = time.process_time() - start
    fitted = cpu_ms(lambda: fit_abilities(comparisons), 3)
    parsed = cpu_ms(lambda: pd.read_csv(path), 3)
    say_ratio("1,000,000 comparisons fitted", fitted, "file read by pandas", parsed)
    say_ratio("1,000,000 comparisons read and fitted", 1000 * read + fitted, "file read by pandas", parsed)
    benchmark(lambda: fit_abilities(comparisons))
