"""Speed of the ANOVA, with the ratio to statsmodels, and of a million ratings from SQL to the tables."""

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from analysis.plans.clip_rating import READING, analyse_study
from analysis.read.study_answers import load_csv, load_database
from analysis.report.within_tables import all_tables
from analysis.within.anova import within_anova
from analysis.within.cell_means import cell_table
from experiments.load import load_experiment
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
