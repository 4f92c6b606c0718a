"""The replay against scripted runs whose stalls are known: on the canvas is the frame that the log says.

Each frame of the clips carries its number as a barcode, which is read from the canvas's pixels.
"""

import uuid
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from fastapi.testclient import TestClient
from playwright.sync_api import Page, expect

from server.app import create_app
from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_walk import shoot
from tests.browser.forked_server import ForkedServer
from tests.browser.participant.test_continuous import declared as continuous
from tests.browser.participant.test_pairs import IN_TURN, PAIRS, STACKED
from tests.browser.participant.test_thresholds import IN_TURN as THRESHOLD
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import axe_violations
from tests.helpers.studies import Participant

pytestmark = pytest.mark.browser
SLOW_MS = 60_000
"""How long a loaded machine may take to load and decode."""
FRAMES, LONG, PERIOD_MS = 12, 930, 1000 / 30
RATING = without(PLAIN, ("trials = 1", "trials = 0"))
KINDS = {
    "rating": (RATING, FRAMES),
    "pairs": (PAIRS, FRAMES),
    "stacked": (STACKED, FRAMES),
    "in_turn": (IN_TURN, FRAMES),
    "threshold": (THRESHOLD, FRAMES),
    "continuous": (continuous("slider"), LONG),
}
BESIDE = {"left", "right"}
# Of the barcode whose left lower corner is at (x, y): its number; -1 where no barcode is.
READ = """({ corners }) => {
  const canvas = document.querySelector(".replay-window canvas");
  const context = canvas.getContext("2d");
  return corners.map(([atRight, atBottom]) => {
    const x = atRight ? canvas.width - 256 : 0, y = atBottom ? canvas.height - 8 : 88;
    const { data } = context.getImageData(x, y, 14 * 16, 1);
    let index = 0;
    for (let bit = 0; bit < 12; bit += 1) if (data[4 * ((bit + 2) * 16 + 8)] > 127) index |= 1 << bit;
    return data[4 * 8] > 200 && data[4 * 24] < 60 ? index : -1;
  });
}"""
CORNERS = {"pairs": {"right": (True, False)}, "stacked": {"right": (False, True)}}
"""The place of a clip that is not in the canvas's upper left corner."""


@dataclass(frozen=True)
class Scripted:
    """A clip's log as it was sent: frames with their times, and when it was over."""

    role: str
    drawn: list[tuple[int, float]]
    ended_ms: float

    def frame_at(self, at_ms: float) -> int:
        """The frame that stood then; -1 for none."""
        row = bisect_right([ms for _, ms in self.drawn], at_ms) - 1
        return -1 if row < 0 or at_ms >= self.ended_ms else self.drawn[row][0]


def stalled(start_ms: float, frames: int) -> list[tuple[int, float]]:
    """In time but for two faults: frame 3 stands for 400 ms, and the three after 7 are never drawn."""
    late = [0.0 if index <= 3 else 400.0 - PERIOD_MS for index in range(frames)]
    times = [round(start_ms + index * PERIOD_MS + late[index], 2) for index in range(frames)]
    return [(index, times[index]) for index in range(frames) if index not in (8, 9, 10)]


def script(trial: Any, frames: int) -> list[Scripted]:
    """The logs of a trial's clips: at once by one clock, or in turn with a pause of 120 ms."""
    logs: list[Scripted] = []
    for clip in trial["clips"]:
        beside = logs and {logs[-1].role, clip["role"]} <= BESIDE
        start = 20.0 if not logs else logs[-1].drawn[0][1] if beside else logs[-1].ended_ms + 120
        drawn = stalled(start, frames)
        logs.append(Scripted(clip["role"], drawn, round(drawn[-1][1] + PERIOD_MS, 2)))
    return logs


ANSWERS: dict[str, dict[str, Any]] = {
    "pairs": {"kind": "paired_comparison", "winner": "left", "arrangement": "side_by_side"},
    "stacked": {"kind": "paired_comparison", "winner": "right", "arrangement": "stacked"},
    "in_turn": {"kind": "paired_comparison", "winner": "left", "arrangement": "one_after_the_other"},
    "threshold": {"kind": "threshold", "chosen": "second", "known": 0},
    "continuous": {"kind": "continuous_rating", "values": [10.0, 60.0, 90.0], "step_frames": 3, "moves": 2},
}


def take_part(client: TestClient, kind: str, link: str, frames: int) -> tuple[str, list[Scripted]]:
    """A run whose first trial was shown as scripted; its id and the script."""
    person = Participant(client, link).agree()
    trial = person.state()["trials"][0]
    logs = script(trial, frames)
    hashes = {clip["role"]: clip["clip_sha256"] for clip in trial["clips"]}
    showings = [
        {"roles": [log.role], "method": "webcodecs", "frames": frames, "fps": 30, "ended_ms": log.ended_ms}
        | {"stalls": 0, "clock_gap_ms": 400.0, "clock_late_ms": 1.0, "focus_lost": 0}
        for log in logs
    ]
    view = {
        "id": str(uuid.uuid4()),
        "trial_index": trial["trial_index"],
        "number": 1,
        "play": 1,
        "started_at_client": "2026-11-21T10:00:00+00:00",
        "ended_at_client": "2026-11-21T10:00:02+00:00",
        "screen": {"width_px": 1280, "height_px": 720, "refresh_rate_hz": 60.0, "device_pixel_ratio": 1},
        "outcome": "shown",
        "showings": showings,
        "clips": [{"role": log.role, "clip_sha256": hashes[log.role], "drawn": log.drawn} for log in logs],
        "disturbances": {"focus_lost": 1},
    }
    assert person.request("POST", "/views", {"views": [view]}).status_code == 200
    happened = {"id": str(uuid.uuid4()), "type": "focus_lost", "at": "2026-11-21T10:00:00.700000+00:00"}
    assert person.request("POST", "/events", {"events": [happened]}).status_code == 200
    given: dict[str, Any] = {"playback": {"drawn": None}, "rt": 600.0}
    given["rt_from_first_frame"] = max(3000.0, logs[-1].ended_ms + 1000)
    if kind == "rating":
        assert person.rate(trial, 5, **given).status_code == 201
    else:
        body = {
            "trial_index": trial["trial_index"],
            "answer": ANSWERS[kind],
            "playback": {"method": "webcodecs"},
        }
        body |= {name: given[name] for name in ("rt", "rt_from_first_frame")}
        answer = person.request("PUT", f"/ratings/{uuid.uuid4()}", body)
        assert answer.status_code == 201, answer.text
    return person.run_id, logs


@dataclass(frozen=True)
class Runs:
    """What was scripted, by kind."""

    server: ServerProcess
    of_kind: dict[str, tuple[str, list[Scripted]]]


@pytest.fixture(scope="module")
def runs(built_admin: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runs]:
    """A server with a run of every kind of trial."""
    folder = tmp_path_factory.mktemp("replay")
    process = ForkedServer(folder / "data")
    made = {}
    with TestClient(create_app(process.settings)) as client:
        for kind, (text, frames) in KINDS.items():
            own = without(text, ('name = "browser"', f'name = "{kind}"'))
            study = process.add_study(folder / kind, own, frames=frames)
            made[kind] = take_part(client, kind, study.link_token, frames)
    yield Runs(process.start(), made)
    process.stop()


@pytest.fixture(scope="module")
def busy_server(runs: Runs) -> ServerProcess:
    return runs.server


def open_replay(dashboard: Dashboard, runs: Runs, kind: str) -> Page:
    run, _ = runs.of_kind[kind]
    page = dashboard.open(f"/studies/{kind}/participants/{run}/replay")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_enabled(timeout=SLOW_MS)
    return page


def go_to(page: Page, at_ms: float) -> None:
    """Set the time, and wait until the canvas shows it."""
    page.get_by_label("Time in ms").fill(f"{at_ms:.2f}")
    wait_painted(page, at_ms)


def wait_painted(page: Page, at_ms: float) -> None:
    """Wait until the canvas shows this moment."""
    # Not wait_for_function: unless true at once it is evaluated by the page, whose policy forbids that.
    page.evaluate(
        """at => new Promise((resolve) => {
            const look = () => {
                const { paintedMs } = document.querySelector(".replay-window canvas").dataset;
                if (Math.abs(Number(paintedMs) - at) < 0.001) resolve();
                else requestAnimationFrame(look);
            };
            look();
        })""",
        at_ms,
    )


def frames_on_canvas(page: Page, kind: str, logs: list[Scripted]) -> list[int]:
    """The numbers read from the pixels, one per clip; clips in turn are at one place and share it."""
    corners = [CORNERS.get(kind, {}).get(log.role, (False, False)) for log in logs]
    read: list[int] = page.evaluate(READ, {"corners": corners})
    return read


@pytest.mark.parametrize("kind", KINDS)
def test_the_canvas_shows_the_frame_that_the_log_says(dashboard: Dashboard, runs: Runs, kind: str) -> None:
    dashboard.complaints.clear()
    page, (_, logs) = open_replay(dashboard, runs, kind), runs.of_kind[kind]
    end = max(log.ended_ms for log in logs)
    edges = [ms for log in logs for _, ms in log.drawn[:13]] + [log.ended_ms for log in logs]
    moments = {round(ms + offset, 2) for ms in edges for offset in (0, -0.5)}
    moments |= {5.0, 200.0, 300.0, round(end * 0.55, 1), round(end - 1, 1), end + 50}
    for at_ms in [*sorted(moments), *sorted(moments)[::-7]]:
        go_to(page, at_ms)
        read = frames_on_canvas(page, kind, logs)
        if kind in ("in_turn", "threshold"):  # at one spot: whichever stands is read twice
            assert set(read) == {max(log.frame_at(at_ms) for log in logs)}, at_ms
        else:
            assert read == [log.frame_at(at_ms) for log in logs], at_ms
    assert dashboard.complaints == []


def test_faults_answers_and_events_are_reported(dashboard: Dashboard, runs: Runs) -> None:
    page = open_replay(dashboard, runs, "rating")
    row = page.get_by_role("region", name="Views").get_by_role("row").nth(1)
    expect(row).to_contain_text("8 to 10", timeout=SLOW_MS)
    expect(row).to_contain_text("frame 3, 400.0 ms", timeout=SLOW_MS)
    expect(row).to_contain_text("focus lost", timeout=SLOW_MS)
    expect(page.get_by_text("Answer: ")).to_contain_text(
        "response 5, at 3.02 s (600 ms after the last", timeout=SLOW_MS
    )
    expect(page.get_by_text("0.70 s: focus lost")).to_be_visible(timeout=SLOW_MS)
    assert page.title().startswith(f"Replay of run {runs.of_kind['rating'][0][:8]}")


def test_keys_go_by_frames_and_trials_and_play(dashboard: Dashboard, runs: Runs) -> None:
    page, (_, logs) = open_replay(dashboard, runs, "rating"), runs.of_kind["rating"]
    seen = []
    for _, ms in logs[0].drawn:
        page.keyboard.press("ArrowRight")
        wait_painted(page, ms)
        seen += frames_on_canvas(page, "rating", logs)
    assert seen == [index for index, _ in logs[0].drawn]
    page.keyboard.press("ArrowLeft")
    wait_painted(page, logs[0].drawn[-2][1])
    page.keyboard.press(" ")
    wait_painted(page, 3020)
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible(timeout=SLOW_MS)
    page.get_by_role("button", name="Previous frame").focus()
    page.keyboard.press(" ")
    wait_painted(page, logs[0].ended_ms)
    page.keyboard.press("ArrowDown")
    page.wait_for_url("**/replay?trial=1")
    expect(page.get_by_text("This trial was not reached")).to_be_visible(timeout=SLOW_MS)
    page.keyboard.press("ArrowUp")
    page.wait_for_url("**/replay?trial=0")


@pytest.mark.parametrize("kind", ["rating", "pairs", "continuous"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_accessible_wide_and_narrow(
    dashboard: Dashboard, runs: Runs, kind: str, scheme: Any
) -> None:
    page = dashboard.page
    page.emulate_media(color_scheme=scheme)
    try:
        open_replay(dashboard, runs, kind)
        for width, height in ((1440, 900), (390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            go_to(page, 300.0)
            assert axe_violations(page) == []
            shoot(dashboard, f"replay-{kind}-{scheme}-{width}")
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, f"the page is {wide} px wide on a screen of {width}"
            go_to(page, 310.0)
    finally:
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1280, "height": 800})


def test_the_way_from_the_run_to_its_replay(dashboard: Dashboard, runs: Runs) -> None:
    run, _ = runs.of_kind["pairs"]
    page = dashboard.open(f"/studies/pairs/participants/{run}")
    # By the keyboard: what the page loads above the link may move it away under a mouse.
    page.get_by_role("link", name="Replay", exact=True).press("Enter")
    expect(page.get_by_role("heading", name="Replay of")).to_be_visible(timeout=SLOW_MS)
    page.get_by_text("In their window").click()
    expect(page.locator(".replay-window canvas")).to_be_visible(timeout=SLOW_MS)
