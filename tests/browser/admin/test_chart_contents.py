"""What charts show in the browser, against means and intervals computed from the exported CSV."""

import csv
import io
import re
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator
from scipy import stats

from tests.browser.admin.conftest import Dashboard

pytestmark = pytest.mark.browser
LEVELS = {"character": ("a", "b"), "speed": ("slow", "fast")}
LABELS = {"a": "A", "b": "B", "slow": "Slow", "fast": "Fast"}
FIGURE = "figure, .plot > div > svg"
PIXEL = 0.03
"""A pixel of a chart of six units; texts are placed to about a pixel."""

# Bars and points in a color of the palette, and the texts, in pixels of the page.
DRAWN = """(plot) => {
  const palette = ['#0072B2', '#D55E00'].map((one) => one.toLowerCase());
  const own = (one, what) => one.getAttribute(what) ?? one.parentElement.getAttribute(what) ?? '';
  const ink = (one, what) => own(one, what).toLowerCase();
  const box = (one) => {
    const { left, right, top, bottom } = one.getBoundingClientRect();
    return { x: (left + right) / 2, y: (top + bottom) / 2, top, bottom, width: right - left };
  };
  const inked = (query, what) => [...plot.querySelectorAll(query)]
    .filter((one) => palette.includes(ink(one, what)))
    .map((one) => ({ ...box(one), r: Number(one.getAttribute('r')) }));
  return {
    bars: inked('line', 'stroke'),
    ends: inked('path', 'stroke').filter((one) => Math.abs(one.width - 14) < 1),
    points: inked('circle', 'fill'),
    texts: [...plot.querySelectorAll('text')].map((one) => ({ text: one.textContent, ...box(one) })),
  };
}"""


@dataclass
class Chart:
    """Bars as (middle, half the length), bar ends, and points by size, left to right, in the axis's units."""

    bars: list[tuple[float, float]]
    ends: list[float]
    points: dict[int, list[float]]
    texts: list[str]


def read_chart(plot: Locator) -> Chart:
    """The bars and points that a browser has drawn."""
    drawn: dict[str, Any] = plot.evaluate(DRAWN)
    ticks = [one for one in drawn["texts"] if re.fullmatch(r"[1-7]", one["text"])]
    slope, offset = np.polyfit([one["y"] for one in ticks], [float(one["text"]) for one in ticks], 1)
    bars = sorted(drawn["bars"], key=lambda one: float(one["x"]))
    points: dict[int, list[float]] = defaultdict(list)
    for one in sorted(drawn["points"], key=lambda one: float(one["x"])):
        points[int(one["r"])].append(float(slope * one["y"] + offset))
    return Chart(
        [(slope * one["y"] + offset, abs(slope) * (one["bottom"] - one["top"]) / 2) for one in bars],
        [float(slope * one["y"] + offset) for one in drawn["ends"]],
        points,
        [one["text"] for one in drawn["texts"]],
    )


def answers_of(dashboard: Dashboard) -> list[dict[str, str]]:
    """The trials of the exported CSV that count."""
    exported = dashboard.page.request.get(
        f"{dashboard.server.address}/api/admin/studies/short/data/ratings.csv"
    )
    rows = list(csv.DictReader(io.StringIO(exported.text().removeprefix("\ufeff"))))
    return [row for row in rows if row["kind"] == "main" and row["verdict"] != "failed"]


def expected_bars(
    rows: list[dict[str, str]], factors: list[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Participants' means, their means, and half-widths of the intervals (Cousineau 2005, Morey 2008)."""
    cells: dict[str, dict[tuple[str, str], list[float]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        cells[row["run"]][row["character"], row["speed"]].append(float(row["response"]))
    conditions = [(x, y) for x in LEVELS[factors[0]] for y in (LEVELS[factors[1]] if factors[1:] else [""])]
    people = []
    for of_run in cells.values():
        means = {cell: float(np.mean(values)) for cell, values in of_run.items()}
        chosen = [
            [mean for cell, mean in means.items() if set(condition) - {""} <= set(cell)]
            for condition in conditions
        ]
        if all(chosen):
            people.append([float(np.mean(values)) for values in chosen])
    y = np.array(people)
    n, k = y.shape
    z = y - y.mean(axis=1, keepdims=True) + y.mean()
    error = np.sqrt(k / (k - 1)) * z.std(axis=0, ddof=1) / np.sqrt(n)
    return y, y.mean(axis=0), stats.t.ppf(0.975, n - 1) * error


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize(
    ("factors", "title"),
    [(["character"], "Character"), (["speed"], "Speed"), (["character", "speed"], "Character x Speed")],
    ids=["character", "speed", "both"],
)
def test_bars_and_points_are_those_computed_from_the_exported_csv(
    dashboard: Dashboard, factors: list[str], title: str, width: int
) -> None:
    page = dashboard.open("/studies/short/results")
    page.set_viewport_size({"width": width, "height": 844})
    plot = page.locator(".plot").filter(
        has=page.locator(f'[aria-label="Marginal means of {title} with within-participant error bars"]')
    )
    plot.locator("svg circle, svg path[fill]").first.wait_for()
    page.wait_for_timeout(400)  # drawn again as wide as its new place
    people, means, halves = expected_bars(answers_of(dashboard), factors)
    chart = read_chart(plot)
    page.set_viewport_size({"width": 1280, "height": 800})
    assert len(people) >= 3
    # The axis is the scale, and bars are cut at its ends.
    low, high = np.clip(means - halves, 1, 7), np.clip(means + halves, 1, 7)
    assert [middle for middle, _ in chart.bars] == pytest.approx(list((low + high) / 2), abs=2 * PIXEL)
    assert [half for _, half in chart.bars] == pytest.approx(list((high - low) / 2), abs=PIXEL)
    # A bar shorter than its point shows by its ends, which are wider.
    assert sorted(chart.ends) == pytest.approx(sorted([*low, *high]), abs=2 * PIXEL)
    if len(factors) == 1:
        assert chart.points[4] == pytest.approx(list(means), abs=2 * PIXEL)
        assert sorted(chart.points[2]) == pytest.approx(sorted(people.ravel()), abs=2 * PIXEL)
    labels = [LABELS[level] for factor in factors for level in LEVELS[factor]]
    assert set(labels[:2]) <= set(chart.texts)
    assert title.split(" x ")[0] in chart.texts
    assert "mean rating" in " ".join(chart.texts)
    caption = plot.locator("figcaption").inner_text()
    assert caption.startswith(f"N = {len(people)}. ")
    assert "Bars: 95% within-participant CI" in caption
    is_cut = bool((means - halves < 1).any() or (means + halves > 7).any())
    assert ("Bars are cut at the ends of the scale" in caption) == is_cut
