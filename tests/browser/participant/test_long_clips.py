"""Clips too long to be kept as pictures: few frames at a time are, all are shown, and the log says so."""

import json
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route

from experiments.load import parse_experiment
from server.cli_common import migrated_services
from server.models import ViewClip
from server.participation.views import unpack_log
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit
from tests.helpers.tiny_clips import make_clip_folder

pytestmark = pytest.mark.browser
FRAMES, SIZE_PX = 200, (960, 360)
"""276 MB as pictures: more than the page keeps of a clip."""
AHEAD_MAX = 40
"""Pictures at once that the page may hold of a clip."""

# In front of the worker's own code: counts open pictures and video frames, and reads the barcode back.
COUNT = """
{
  const channel = new BroadcastChannel("pictures");
  let live = 0, most = 0, made = 0;
  const born = () => { live += 1; made += 1; most = Math.max(most, live); };
  const make = self.createImageBitmap;
  self.createImageBitmap = async (...parts) => {
    const bitmap = await make(...parts);
    born();
    return bitmap;
  };
  const close = ImageBitmap.prototype.close;
  ImageBitmap.prototype.close = function () { if (this.width > 0) live -= 1; close.call(this); };
  let frames = 0, frames_most = 0;
  const Decoder = self.VideoDecoder;
  self.VideoDecoder = class extends Decoder {
    constructor(init) {
      const output = (frame) => {
        frames += 1;
        frames_most = Math.max(frames_most, frames);
        init.output(frame);
      };
      super({ ...init, output });
    }
  };
  const close_frame = VideoFrame.prototype.close;
  VideoFrame.prototype.close = function () {
    if (this.format !== null) frames -= 1;
    close_frame.call(this);
  };
  const draw = OffscreenCanvasRenderingContext2D.prototype.drawImage;
  const seen = [];
  OffscreenCanvasRenderingContext2D.prototype.drawImage = function (picture, x, ...parts) {
    draw.call(this, picture, x, ...parts);
    const cell = 16 * parts[1] / picture.width;
    const { data } = this.getImageData(x, this.canvas.height - 8, Math.ceil(14 * cell), 1);
    let index = 0;
    const bright = (place) => data[4 * Math.floor((place + 0.5) * cell)] > 127;
    for (let bit = 0; bit < 12; bit += 1) if (bright(bit + 2)) index |= 1 << bit;
    seen.push(index);
  };
  setInterval(() => channel.postMessage({ live, most, made, frames, frames_most, seen }), 200);
}
"""
LISTEN = """
new BroadcastChannel("pictures").onmessage = ({ data }) => { window.pictures = data; };
"""
ONE = without(PLAIN, ("per_cell = 3", "per_cell = 1"), ("trials = 1", "trials = 0"))
PAIR = (
    ONE[: ONE.index("[trial]")].replace('split_by = "character"\n', "")
    + """
[trial]
kind = "paired_comparison"
question = { en = "Which eyes looked more alive?", de = "Welche Augen wirkten lebendiger?" }
pairs = { among = "all", exemplars = "matched" }
presentation = { arrangement = "side_by_side", if_too_narrow = "stack" }
"""
    + ONE[ONE.index("[[forms]]") :]
)


def watched(page: Page) -> None:
    def change(route: Route) -> None:
        answer = route.fetch()
        route.fulfill(response=answer, body=COUNT + answer.text())

    page.context.route("**/assets/participant/worker-*.js", change)
    page.add_init_script(LISTEN)


def played(
    server: ServerProcess, folder: Path, page: Page, declared: str, answer: tuple[str, str]
) -> tuple[dict[str, Any], dict[str, Any], Visit]:
    """One trial of long clips: what the worker held, and the stored rating."""
    make_clip_folder(parse_experiment(declared), folder, frames=FRAMES, size_px=SIZE_PX)
    study = server.add_built_study(folder, declared)
    server.start()
    watched(page)
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    asked, key = answer
    page.wait_for_selector(asked)
    page.keyboard.press(key)
    rows = server.rows_soon("SELECT t.* FROM trial_ratings t", 1)
    return page.evaluate("window.pictures"), rows[0], visit


def indices(row: dict[str, Any]) -> list[int]:
    log = row["drawn"]
    return [index for index, _ in (json.loads(log) if isinstance(log, str) else log)]


def test_a_long_clip_is_decoded_while_it_is_shown(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    held, row, visit = played(server, tmp_path / "clips", page, ONE, (".scale", "4"))
    # Frames were pictures once, and never many of them at once.
    assert held["made"] >= FRAMES / 4
    assert held["most"] <= AHEAD_MAX
    assert held["frames_most"] <= AHEAD_MAX
    logged = indices(row)
    assert held["seen"][: len(logged)] == logged
    assert row["frames_drawn"] + row["frames_missing"] == FRAMES
    # A busy machine loses frames, and its verdict says so; one that only begins shows the 32 fed at first.
    assert row["frames_drawn"] >= FRAMES / 4
    assert visit.problems == []


def test_two_long_clips_side_by_side_are_drawn_by_one_clock(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    page.set_viewport_size({"width": 2000, "height": 800})
    answer = (".pair-answers", "ArrowRight")
    held, row, visit = played(server, tmp_path / "clips", page, PAIR, answer)
    assert held["most"] <= 2 * AHEAD_MAX
    assert held["frames_most"] <= 2 * AHEAD_MAX
    # The two pictures of one refresh are of one frame, and the record names that frame for each.
    left, right = held["seen"][0::2], held["seen"][1::2]
    assert left == right
    with migrated_services(server.settings) as services, services.database.read() as session:
        clips = session.query(ViewClip).order_by(ViewClip.role).all()
        logs = {clip.role: [index for index, _ in unpack_log(clip.frame_log)] for clip in clips}
    assert logs == {"left": left, "right": left}
    assert len(set(left)) >= FRAMES / 4
    assert row["payload"]
    assert visit.problems == []
