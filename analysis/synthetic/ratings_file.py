"""Ratings of synthetic participants as the server's CSV export."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from analysis.synthetic.synthesise import Synthetic
from analysis.synthetic.trials import Totals, rating_rows
from experiments.files import whole_file
from experiments.spreadsheet import guarded_row
from experiments.trials.clip_rating.columns import RATINGS


def write_ratings(scales: Sequence[Synthetic], out: Path) -> int:
    """Write the ratings as the server's CSV export, every row marked synthetic.

    Parameters
    ----------
    scales : sequence of Synthetic
        The same participants on every scale of the study, in order.
    out : Path
        The CSV file.

    Returns
    -------
    int
        Rows: one a trial and scale.
    """
    first = scales[0]
    header = RATINGS.csv_header(first.experiment.factor_names)
    rng = np.random.default_rng([first.seed, 1])
    sums = [Totals(made.scale, made.sums) for made in scales]
    count = 0
    with whole_file(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.writer(handle, lineterminator="\n")
        writer.writerow(guarded_row(header))
        for row in rating_rows(first.experiment, first.space, sums, rng):
            writer.writerow(guarded_row(row[name] for name in header))
            count += 1
    return count
