"""A reference before each rated clip in a real Chromium: both drawn and logged in one view."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from server.cli_common import migrated_services
from server.models import ViewClip
from server.participation.views import unpack_log
from tests.browser.served import Served, go_back, serve
from tests.browser.studies import PLAIN
from tests.browser.visit import axe_violations

pytestmark = pytest.mark.browser

GAP_MS = 200
DEGRADED = (
    PLAIN.replace('split_by = "character"\n', "")
    .replace("per_cell = 3", "per_cell = 1")
    .replace("trials = 1", "trials = 0")
    .replace(
        "[[forms]]",
        "[trial.reference]\n"
        f'factor = "character"\nlevel = "a"\ngap_ms = {GAP_MS}\nrate_itself = true\n'
        'label = { en = "Reference", de = "Referenz" }\n\n'
        '[playback.disturbances]\nfocus_lost = "flag"\n\n[[forms]]',
        1,
    )
)


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    """A server that refuses answers whose clips were not there."""
    with serve(tmp_path_factory.mktemp("dcr"), {"dcr": (DEGRADED, 20)}, evidence="refuse") as served:
        yield served


def test_a_reference_and_the_rated_clip_are_one_view(studies: Served, page: Page) -> None:
    visit = studies.visit("dcr", page)
    page.evaluate(
        """() => { window.labels = []; new MutationObserver(() => {
            const said = document.querySelector(".trial.playing .below")?.textContent;
            if (said === "" && window.labels.length === 1 && !window.away) {
                window.away = true;
                window.dispatchEvent(new Event("blur"));
            }
            if (said && said !== window.labels.at(-1)) window.labels.push(said);
        }).observe(document.body, { subtree: true, childList: true, attributes: true }); }"""
    )
    page.keyboard.press(" ")
    page.wait_for_selector(".scale")
    assert axe_violations(page) == []
    labels = page.evaluate("() => window.labels")
    assert labels[0] == "Reference"
    assert len(labels) == 2
    page.reload()
    go_back(page)
    page.wait_for_selector(".scale")
    assert "already seen" in page.inner_text(".above"), "the scale comes back, the clips do not"
    page.keyboard.press("4")
    page.wait_for_selector(".ready")
    visit.trials()
    assert visit.problems == []
    rows = studies.rows_of_latest("ratings", "time_elapsed", 2)
    assert [(row["reference"], row["response"], row["views"]) for row in rows] == [("a", 4, 1)] * 2
    assert {row["cell"] for row in rows} == {"a", "b"}
    assert {row["verdict_rule"] for row in rows}.isdisjoint({"wrong_clip", "frame_log_disagrees"})
    assert json.loads(str(rows[0]["disturbances"]))["scale_reloaded"] == 1
    assert [json.loads(str(row["disturbances"])).get("focus_lost") for row in rows] == [1, None], "in the gap"
    ids = [view["id"] for view in studies.views(2)]
    with migrated_services(studies.server.settings) as services, services.database.read() as session:
        stored = session.query(ViewClip).where(ViewClip.view.in_(ids)).all()
        logs = [{clip.role: unpack_log(clip.frame_log) for clip in stored if clip.view == one} for one in ids]
    for row, log in zip(rows, logs, strict=True):
        gap_ms = log["shown"][0][1] - log["reference"][-1][1]
        assert gap_ms >= GAP_MS, "the gap is not shorter than declared"
        assert row["reference_gap_ms"] == pytest.approx(gap_ms, abs=1)
