"""The sync patch in a real Chromium: white without a clip, and each picture of a clip with its number."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from stimuli_builder.sync_patch import film as patch_code
from tests.browser.served import Served, serve, start_clip
from tests.browser.studies import PLAIN, without

pytestmark = pytest.mark.browser

FRAMES = 60
DECLARED = without(PLAIN, ("trials = 1", "trials = 0"), ("[display]", "[display]\nsync_patch = true"))
PARTS = 12
"""The clip's height in parts of which the patch's fields are one high, with a rim of one part."""


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    with serve(tmp_path_factory.mktemp("sync"), {"sync_patch": (DECLARED, FRAMES)}) as served:
        yield served


def number_on(page: Page) -> int:
    """What the patch of the clip's place says on a screenshot."""
    box = page.locator(".clip").bounding_box()
    assert box is not None
    picture = np.array(Image.open(io.BytesIO(page.screenshot())).convert("L"), float) / 255
    part = box["height"] / PARTS
    rows = [int(box["y"] + box["height"] - part * (3.5 - row)) for row in range(3)]
    columns = [int(box["x"] + part * (1.5 + column)) for column in range(3)]
    return int(patch_code.read_numbers(picture[np.ix_(rows, columns)].reshape(1, -1))[0])


def test_every_picture_carries_its_number(studies: Served, page: Page) -> None:
    visit = studies.visit("sync_patch", page)
    assert number_on(page) == patch_code.NO_FRAME
    start_clip(page)
    seen = []
    while page.query_selector(".trial.playing"):
        seen.append(number_on(page))
    frames = [number for number in seen if number >= 0]
    assert len(set(frames)) >= 2, f"read on screenshots: {seen}"
    assert frames == sorted(frames)
    assert max(frames) < FRAMES
    page.wait_for_selector(".scale")
    assert number_on(page) == patch_code.NO_FRAME
    assert visit.problems == []
