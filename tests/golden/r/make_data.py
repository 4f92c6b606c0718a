"""Write the data behind the R golden files: seeded, rounded so that every reader parses it alike.

Run from this folder: `python make_data.py`. The CSV files are committed; rerun only to add a case.
"""

import csv
import itertools
from pathlib import Path
from zlib import crc32

import numpy as np

HERE = Path(__file__).parent

# name: (participants, levels of A, B, ..., trials per cell or (fewest, most), kind of rating)
WITHIN = {
    "complete_1": (20, (4,), 1, "continuous"),
    "complete_2": (15, (3, 4), 1, "continuous"),
    "complete_3": (24, (2, 2, 3), 1, "continuous"),
    "complete_4": (32, (2, 2, 2, 2), 2, "continuous"),
    "complete_4_mixed_levels": (40, (2, 3, 2, 2), 1, "continuous"),
    "unbalanced_1": (12, (5,), (1, 6), "continuous"),
    "unbalanced_2": (18, (2, 3), (1, 7), "rating"),
    "unbalanced_3": (16, (2, 3, 2), (1, 5), "continuous"),
    "unbalanced_4": (22, (2, 2, 2, 3), (1, 4), "rating"),
    "few_participants_1": (4, (6,), 1, "continuous"),
    "few_participants_2": (6, (3, 4), 2, "continuous"),
    "few_participants_3": (9, (5, 4, 2), 1, "continuous"),
    "few_participants_4": (5, (3, 2, 2, 3), 1, "continuous"),
    "just_enough_1": (5, (5,), 1, "continuous"),
    "integer_1": (20, (4,), 1, "rating"),
    "integer_2": (43, (5, 4), 1, "rating"),
    "integer_3": (32, (2, 2, 2), 1, "rating"),
    "integer_4": (32, (2, 2, 2, 2), 1, "rating"),
}


def cell_means(rng, participants, sizes):
    """Participants x cells with correlated, heteroscedastic cells and real effects."""
    cells = int(np.prod(sizes))
    mixing = rng.normal(size=(cells, cells)) * rng.uniform(0.2, 0.8, size=(cells, 1)) / np.sqrt(cells)
    noise = rng.normal(size=(participants, cells)) @ mixing + rng.normal(size=(participants, cells)) * 0.5
    return 4.2 + rng.normal(size=cells) * 0.35 + rng.normal(size=(participants, 1)) * 0.7 + noise


def trials_of(rng, mean, trials, kind):
    count = trials if isinstance(trials, int) else int(rng.integers(trials[0], trials[1] + 1))
    values = mean + rng.normal(size=count) * 0.8
    if kind == "rating":
        return [int(v) for v in np.clip(np.rint(values), 1, 7)]
    return [round(float(v), 3) for v in values]


def write_within(name, participants, sizes, trials, kind):
    rng = np.random.default_rng(crc32(name.encode()))
    means = cell_means(rng, participants, sizes)
    factors = "ABCD"[: len(sizes)]
    levels = [[f"{f.lower()}{i + 1}" for i in range(n)] for f, n in zip(factors, sizes, strict=True)]
    with (HERE / "within" / f"{name}.csv").open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["participant", *factors, "rating"])
        for person in range(participants):
            for cell, names in enumerate(itertools.product(*levels)):
                for value in trials_of(rng, means[person, cell], trials, kind):
                    writer.writerow([f"p{person + 1:02d}", *names, value])


# name: (participants, levels of the factors, clips per cell, share of trials kept, slope SDs, kind)
# Clips are nested in A (a clip shows one level of A) and crossed with the other factors.
MODELS = {
    "mixed_two_by_two": (24, (2, 2), 6, 1.0, (0.45, 0.35), "continuous"),
    "mixed_three_levels": (20, (3, 2), 5, 1.0, (0.5, 0.4), "continuous"),
    "mixed_unbalanced": (18, (2, 3), 6, 0.75, (0.5, 0.4), "rating"),
    "mixed_no_slopes": (16, (2, 2), 5, 1.0, (0.0, 0.0), "continuous"),
    "mixed_exp1": (32, (2, 2, 2, 2), 20, 0.25, (0.4, 0.3, 0.3, 0.5), "rating"),
    "ordinal_small": (15, (2, 2), 5, 1.0, (0.0, 0.0), "rating"),
    "ordinal_three_levels": (20, (3, 2), 6, 0.8, (0.2, 0.2), "rating"),
    "ordinal_rare_categories": (12, (2, 2), 4, 1.0, (0.0, 0.0), "extreme"),
}


def model_rows(rng, participants, sizes, clips, kept, slopes, kind):
    """Yield rows (participant, clip, levels..., rating) of crossed participants and clips."""
    cells = list(itertools.product(*[range(n) for n in sizes]))
    fixed = [rng.normal(size=n) * 0.35 for n in sizes]
    clip_effect = rng.normal(size=(sizes[0], clips)) * 0.3
    person_effect = rng.normal(size=participants) * 0.6
    person_slopes = [rng.normal(size=(participants, n)) * s for n, s in zip(sizes, slopes, strict=True)]
    centre, stretch = (5.8, 1.6) if kind == "extreme" else (4.2, 1.0)
    for person in range(participants):
        for cell in cells:
            for clip in range(clips):
                if rng.random() >= kept:
                    continue
                value = centre + person_effect[person] + clip_effect[cell[0], clip] + rng.normal() * 0.9
                value += sum(fixed[i][c] + person_slopes[i][person, c] for i, c in enumerate(cell))
                value = 4 + (value - 4) * stretch if kind == "extreme" else value
                shown = round(float(value), 3) if kind == "continuous" else int(np.clip(np.rint(value), 1, 7))
                names = [f"{'abcd'[i]}{c + 1}" for i, c in enumerate(cell)]
                yield [f"p{person + 1:02d}", f"a{cell[0] + 1}_clip{clip + 1:02d}", *names, shown]


def write_model(name, participants, sizes, clips, kept, slopes, kind):
    rng = np.random.default_rng(crc32(name.encode()))
    with (HERE / "models" / f"{name}.csv").open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["participant", "clip", *"ABCD"[: len(sizes)], "rating"])
        writer.writerows(model_rows(rng, participants, sizes, clips, kept, slopes, kind))


def write_far_apart():
    """Ordinal ratings of people whose intercepts have SD 4: Laplace's approximation is poor."""
    rng = np.random.default_rng(5)
    with (HERE / "models" / "ordinal_far_apart.csv").open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["participant", "A", "rating"])
        for person in range(8):
            own = rng.normal(0, 4)
            for level, _ in itertools.product(range(3), range(30)):
                latent = 0.6 * level + own + rng.logistic()
                writer.writerow(
                    [person + 1, f"a{level}", int(np.searchsorted([-1.5, -0.5, 0.5, 1.5], latent)) + 1]
                )


def hard_rows(seed, people, items, levels, crossed):
    """Continuous ratings of items that people see at every level, or (not crossed) at one."""
    rng = np.random.default_rng(seed)
    own, slopes, of_item = (
        rng.normal(0, 1, people),
        rng.normal(0, 0.5, (people, levels)),
        rng.normal(0, 0.5, items),
    )
    for person, item in itertools.product(range(people), range(items)):
        for level in range(levels) if crossed else [item % levels]:
            value = 4 + 0.3 * level + own[person] + slopes[person, level] + of_item[item] + rng.normal()
            yield [person + 1, f"i{item}", f"a{level}", round(float(value), 2)]


def write_hard(name, rows):
    with (HERE / f"hard_{name}.csv").open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["participant", "item", "A", "score"])
        writer.writerows(rows)


def write_hard_cases():
    write_hard("three_people", hard_rows(4, 3, 4, 2, crossed=True))
    rows = list(hard_rows(5, 9, 9, 3, crossed=False))
    kept = np.sort(np.random.RandomState(5).choice(len(rows), len(rows) - 6, replace=False))
    write_hard("flat_profile", [rows[k] for k in kept])


if __name__ == "__main__":
    for name, case in WITHIN.items():
        write_within(name, *case)
    for name, case in MODELS.items():
        write_model(name, *case)
    write_far_apart()
    write_hard_cases()
