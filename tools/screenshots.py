"""Pictures for README and docs, made by the program itself: `make screenshots` writes them to docs/images.

    python tools/screenshots.py                       all of them, which needs the clips of `make run`
    python tools/screenshots.py builder performance   some parts

Real servers, the real Experiment 3, a real Chromium. Ratings are synthetic or simulated; the pictures say so.
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import Page, expect, sync_playwright

from experiments.declaration.rendering import RenderSettings
from server.accounts import invitations
from server.cli_common import migrated_services
from stimuli_builder.blinks.blink_model import default_model, textbook_profile
from stimuli_builder.blinks.profile import resample, to_full_closure
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.clips.characters import find_character, geometry, shipped_names
from stimuli_builder.clips.curves import ClipCurve, Timing, clip_curve
from stimuli_builder.clips.design_clips import performance_curve
from stimuli_builder.clips.exemplars import exemplar
from stimuli_builder.clips.face_movement import moved_levels
from stimuli_builder.clips.frames import FramePainter, frame_weights, frame_windows
from stimuli_builder.clips.geometry import Movement
from stimuli_builder.clips.kernels import FULL_SCALE
from stimuli_builder.clips.levels import LevelSet
from tests.browser.conftest import CHROMIUM_FLAGS
from tests.browser.server_process import ServerProcess
from tests.helpers.admins import PASSWORD

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"
STIMULI = ROOT / "data" / "stimuli"
BIN = ROOT / ".venv" / "bin"


def call(*command: str | Path) -> None:
    subprocess.run([BIN / str(command[0]), *map(str, command[1:])], cwd=ROOT, check=True)


@contextmanager
def browser_page(width: int, height: int) -> Iterator[Page]:
    """A page of a Chromium that lasts as long as the block."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS)
        yield browser.new_page(viewport={"width": width, "height": height}, locale="en-GB")
        browser.close()


def analysis_pictures(folder: Path) -> None:
    """Table III from synthetic ratings."""
    ratings, report = folder / "exp3.csv", folder / "report"
    call("analysis", "synthesise", "exp3", "--seed", "1", "--out", ratings)
    call("analysis", "run", "exp3", "--csv", ratings, "--out", report)
    with browser_page(900, 760) as page:
        page.goto(next(report.glob("*.html")).as_uri())
        page.get_by_role("heading", name="Results", exact=True).evaluate(
            "element => element.scrollIntoView()"
        )
        keep(page, "table")


def participant_pictures(folder: Path) -> None:
    """The trial's two screens, with the real clips, as a person sees them."""
    process = ServerProcess(folder / "data")
    declaration = (ROOT / "experiments" / "exp3.toml").read_text(encoding="utf-8")
    declared = declaration.replace('calibrate = "required"', 'calibrate = "off"')
    study = process.add_built_study(built_clips(), declared)
    process.start()
    try:
        with browser_page(1180, 760) as page:
            visit(page, f"{process.address}/run/{study.link_token}")
    finally:
        process.stop()


def built_clips() -> Path:
    """The folder of Experiment 3's clips, which `make run` builds."""
    clips = STIMULI / "exp3"
    if not (clips / "manifest.json").is_file():
        sys.exit(f"error: expected the built clips of exp3 in {clips}; run `make run`")
    return clips


def keep(page: Page, name: str) -> None:
    """Write what a page shows as WebP: lossless, or lossy where a face in it makes that the smaller file."""
    picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
    files = [BytesIO(), BytesIO()]
    picture.save(files[0], "WEBP", lossless=True, quality=100, method=6)
    picture.save(files[1], "WEBP", quality=QUALITY, method=6)
    (IMAGES / f"{name}.webp").write_bytes(min((file.getvalue() for file in files), key=len))


def visit(page: Page, address: str) -> None:
    """From the link to the first rating."""
    page.goto(address)
    page.wait_for_selector("text=About")
    page.click(".primary")
    page.check("input[type=checkbox]")
    page.click(".primary")
    page.wait_for_selector("form")
    page.fill("input.short", "34")
    page.check("input[value=normal]")
    page.click(".primary")
    page.wait_for_selector(".prose h1, .prose h2")
    page.click(".primary")
    page.wait_for_selector("text=not part of the study")
    page.click(".primary")
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_timeout(500)
    keep(page, "participant")
    page.wait_for_selector(".scale")
    keep(page, "scale")


PAGES = {
    "admin-monitor": "/studies/exp3/monitor",
    "admin-results": "/studies/exp3/results",
    "admin-blinks": "/blinks",
}
PEOPLE = 12


def admin_pictures(folder: Path) -> None:
    """The dashboard of a study with simulated people, as its owner sees it."""
    process = ServerProcess(folder / "data")
    declaration = (ROOT / "experiments" / "exp3.toml").read_text(encoding="utf-8")
    process.add_built_study(built_clips(), declaration)
    if (STIMULI / "strips").is_dir():
        shutil.copytree(STIMULI / "strips", process.settings.strips_folder)
    process.start()
    try:
        simulate(process.settings.data_folder, process.settings.secret_key, process.address)
        with browser_page(1440, 900) as page:
            sign_in(page, process.address, process.settings)
            for name, path in PAGES.items():
                page.goto(f"{process.address}/admin{path}")
                show_simulated(page)
                keep(page, name)
    finally:
        process.stop()


def show_simulated(page: Page) -> None:
    """Wait for what a page shows, and have those shown who took part: simulated people."""
    page.wait_for_load_state("load")
    page.wait_for_timeout(1500)
    simulated = page.get_by_role("radiogroup").get_by_text("Simulated")
    if simulated.count():
        simulated.click()
    page.wait_for_timeout(3000)


def simulate(data: Path, key: str, address: str) -> None:
    environment = os.environ | {"PALPEBRA_DATA_FOLDER": str(data), "PALPEBRA_SECRET_KEY": key}
    command = [
        sys.executable,
        "-m",
        "server",
        "simulate",
        "exp3",
        "--participants",
        str(PEOPLE),
        "--url",
        address,
    ]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)


def sign_in(page: Page, address: str, settings) -> None:  # type: ignore[no-untyped-def]
    with migrated_services(settings) as services:
        _, token = invitations.invite(services.database, "owner", "", None)
    page.goto(f"{address}/admin/invitation#{token}")
    page.get_by_label("User name").fill("ada")
    page.locator("input[autocomplete=new-password]").fill(PASSWORD)
    page.get_by_role("button", name="Create account").click()
    page.get_by_role("heading", name="Studies").wait_for()


SECTIONS = ("study", "factors", "trial", "order", "forms", "texts", "screen", "rules", "analysis", "dataset")
ROBOTS = {"rosie": (196, 112, 72), "tin": (120, 124, 132)}
SPEEDS = {"slow": 24, "middle": 14, "fast": 7}
COLOURS = 64
FRAMES, FPS, WIDTH, HEIGHT = 48, 30, 320, 180


def robot_clips(folder: Path) -> list[Path]:
    """Two robots that blink at three speeds, two clips each."""
    paths = []
    for robot, colour in ROBOTS.items():
        for speed, frames in SPEEDS.items():
            for number in (1, 2):
                paths.append(folder / f"{robot}_{speed}_{number}.mp4")
                write_robot_clip(paths[-1], colour, frames, 10 + 4 * number)
    return paths


def write_robot_clip(path: Path, colour: tuple[int, int, int], closing: int, start: int) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for number in range(FRAMES):
            shut = max(0.0, 1 - abs(number - start - closing / 2) / (closing / 2))
            frame = av.VideoFrame.from_ndarray(robot_face(colour, shut), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def robot_face(colour: tuple[int, int, int], shut: float) -> np.ndarray:
    """A robot's face with its lids `shut` that far (0 open, 1 closed)."""
    picture = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    cv2.rectangle(picture, (70, 20), (250, 160), colour, -1)
    for x in (120, 200):
        cv2.ellipse(picture, (x, 80), (26, 20), 0, 0, 360, (245, 245, 240), -1)
        cv2.circle(picture, (x, 80), 9, (30, 30, 40), -1)
        cv2.rectangle(picture, (x - 30, 58), (x + 30, 58 + round(44 * shut)), colour, -1)
    cv2.rectangle(picture, (130, 125), (190, 132), (60, 60, 66), -1)
    return picture


def keep_in_palette(page: Page, name: str) -> None:
    """Photograph the page as it is, in a palette: text and flat areas lose nothing."""
    page.wait_for_load_state("networkidle")
    picture = Image.open(io.BytesIO(page.screenshot(animations="disabled")))
    palette = picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    palette.save(IMAGES / f"builder-{name}.png", optimize=True)


def new_study(page: Page, address: str, files: list[Path]) -> None:
    page.goto(f"{address}/admin/studies/new")
    page.get_by_label("Short name").fill("robots")
    page.get_by_role("tab", name="From your own clips").click()
    page.locator('input[type="file"]:not([accept=".zip"])').first.set_input_files(files)
    page.get_by_text("12 clips uploaded").wait_for()
    page.get_by_label("Pattern", exact=True).fill("{robot}_{speed}_{exemplar}.mp4")
    page.get_by_role("radio", name="Several sliders").click()
    page.get_by_label("Title of the study").fill("Blinking robots")
    page.get_by_label("Question", exact=True).fill("How alive does this robot look?")
    keep_in_palette(page, "new")
    page.get_by_role("button", name="Create").click()
    page.get_by_text("robots, version 1").wait_for()


def build_study(page: Page, address: str) -> None:
    """A practice, a slider and a questionnaire; then a picture of each page."""
    page.get_by_role("tab", name="Build").click()
    page.get_by_role("link", name="Practice and order").click()
    page.get_by_label("Trials", exact=True).fill("3")
    page.get_by_role("link", name="Questionnaires").click()
    page.get_by_role("button", name="Add from the question bank").click()
    page.get_by_role("menuitem", name="Demographics").click()
    save = page.get_by_role("button", name="Save as a new version")
    save.click()
    page.get_by_text("robots, version 2").wait_for()
    for section in SECTIONS:
        page.goto(f"{address}/admin/studies/robots/build?section={section}")
        save.wait_for()
        if section == "factors":
            expect(page.locator(".grid-of-cells canvas[data-drawn]")).to_have_count(12)
        keep_in_palette(page, section)


def go_live(page: Page, address: str) -> None:
    page.goto(f"{address}/admin/studies/robots/clips")
    page.get_by_text("12 clips").first.wait_for()
    keep_in_palette(page, "clips")
    page.goto(f"{address}/admin/studies/robots/rehearsal")
    page.get_by_role("button", name="Rehearse").click()
    page.get_by_text("Assumed:").wait_for(timeout=300_000)
    page.evaluate("window.scrollTo(0, 0)")
    keep_in_palette(page, "rehearsal")
    page.get_by_role("button", name="Set live").click()
    page.get_by_role("dialog").get_by_role("button", name="Set live").click()
    # The checklist before has words in code, too.
    page.get_by_text("Participants can start", exact=True).wait_for()
    page.get_by_role("dialog").locator("code").first.wait_for()
    keep_in_palette(page, "live")


def builder_pictures(folder: Path) -> None:
    """As docs/how-to/build-a-study.md: twelve clips are drawn, brought by a browser and made a study."""
    process = ServerProcess(folder / "data").start()
    try:
        with browser_page(1440, 900) as page:
            sign_in(page, process.address, process.settings)
            new_study(page, process.address, robot_clips(folder))
            build_study(page, process.address)
            go_live(page, process.address)
    finally:
        process.stop()


RECORDED_SIZE, RECORDED_FPS = (1280, 720), 10
MAX_BYTES = 2_000_000


def recording_pictures(folder: Path) -> None:
    """A silent screen recording: from twelve own clips to the link for participants."""
    process = ServerProcess(folder / "data").start()
    shown: list[tuple[float, bytes]] = []
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS, slow_mo=350
            )
            width, height = RECORDED_SIZE
            page = browser.new_page(viewport={"width": width, "height": height})
            sign_in(page, process.address, process.settings)
            session = page.context.new_cdp_session(page)

            def take(event: dict[str, Any]) -> None:
                shown.append((event["metadata"]["timestamp"], base64.b64decode(event["data"])))
                session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})

            session.on("Page.screencastFrame", take)
            session.send("Page.startScreencast", {"format": "jpeg", "quality": 90})
            record_own_clips(page, process.address, robot_clips(folder))
            session.send("Page.stopScreencast")
            browser.close()
    finally:
        process.stop()
    target = ROOT / "docs" / "_static" / "own-clips.mp4"
    write_small_video(shown, target)
    if target.stat().st_size > MAX_BYTES:
        sys.exit(f"error: {target} has {target.stat().st_size} bytes, expected at most {MAX_BYTES}")


def record_own_clips(page: Page, address: str, files: list[Path]) -> None:
    """The steps of the lesson, slowly."""
    page.goto(f"{address}/admin/studies/new")
    page.get_by_label("Short name").press_sequentially("robots", delay=80)
    page.get_by_role("tab", name="From your own clips").click()
    page.locator('input[type="file"]:not([accept=".zip"])').first.set_input_files(files)
    page.get_by_text("12 clips uploaded").wait_for()
    page.get_by_label("Pattern", exact=True).fill("{robot}_{speed}_{exemplar}.mp4")
    page.get_by_label("Title of the study").press_sequentially("Blinking robots", delay=60)
    page.get_by_label("Question", exact=True).clear()
    page.get_by_label("Question", exact=True).press_sequentially("How alive does it look?", delay=50)
    page.get_by_role("button", name="Create").click()
    page.get_by_text("robots, version 1").wait_for()
    page.wait_for_timeout(1500)
    page.get_by_role("tab", name="Build").click()
    page.wait_for_timeout(1500)
    page.get_by_role("link", name="Trial").click()
    page.wait_for_timeout(2500)
    page.get_by_role("button", name="Set live").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_role("button", name="Set live").click()
    dialog.locator("code").first.wait_for()
    page.wait_for_timeout(3000)


def write_small_video(shown: list[tuple[float, bytes]], target: Path) -> None:
    """Write pictures with their times (s) as H.264 at a few frames per second, enough for pages."""
    with av.open(str(target), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=RECORDED_FPS, options={"crf": "28", "preset": "slow"})
        stream.width, stream.height = RECORDED_SIZE
        stream.pix_fmt = "yuv420p"
        start = shown[0][0]
        ends = [time_s for time_s, _ in shown[1:]] + [shown[-1][0] + 2.0]
        for (_, picture), end in zip(shown, ends, strict=True):
            frame = av.VideoFrame.from_image(Image.open(BytesIO(picture)).convert("RGB"))
            while stream.frames / RECORDED_FPS < end - start:
                container.mux(stream.encode(frame.reformat(*RECORDED_SIZE, format="yuv420p")))
        container.mux(stream.encode())


SIZE = (960, 360)
SHEET_CLOSURES = np.linspace(0.0, 1.0, 16)
ENLARGED_CLOSURES, TIMES = (0.0, 0.33, 0.67, 1.0), 3
TILE_PX = 480
MOVED, LOWERED = "hazel@7", "alder@8"
"""Whose brow, cheek, squint and gaze are shown moved, and whose lower lid: one face each, for its size."""
FACES_IN_A_ROW = 6
QUALITY = 80
"""WebP's quality: a quarter of the size of a similar JPEG. Every picture stays in the history of a clone."""
Rgb = NDArray[np.uint8]


def character_pictures(_: Path) -> None:
    """Every character that ships, a blink, and the profiles of Experiment 2."""
    for name in shipped_names():
        whole = find_character(name).geometry.size_px
        tall = whole[1] > whole[0]
        character = find_character(name).levels(whole if tall else SIZE)
        save(closures_sheet(character), IMAGES / f"{name}-closures.webp")
        save(blink_sheet(character, tall), IMAGES / f"{name}-blink.webp")
        if name == LOWERED:
            save(lower_lid_sheet(character), IMAGES / f"{name}-lower-lid.webp")
        if name == MOVED:
            save(movement_sheet(character, name), IMAGES / "face-movement.webp")
    profile_curves(IMAGES / "profiles.webp")


def closures_sheet(character: LevelSet) -> Rgb:
    """What a blink changes at sixteen closures, four in a row, and one eye at four of them, enlarged."""
    window = character.window.slices
    tiles = []
    for closure in SHEET_CLOSURES:
        part = character.picture(float(closure))[window]
        height = round(part.shape[0] * TILE_PX / part.shape[1])
        tiles.append(cv2.resize(part, (TILE_PX, height), interpolation=cv2.INTER_AREA))
    return np.vstack([in_rows(tiles, 4), enlarged_eye(character)])


def enlarged_eye(character: LevelSet) -> Rgb:
    """The eye at the left, three times actual size, at four closures side by side."""
    rows, columns = character.window.slices
    width = TILE_PX // TIMES
    middle = columns.start + (columns.stop - columns.start) // 4
    across = slice(max(0, middle - width // 2), max(0, middle - width // 2) + width)
    parts = [character.picture(closure)[rows, across] for closure in ENLARGED_CLOSURES]
    size = (TILE_PX, parts[0].shape[0] * TIMES)
    return np.hstack([cv2.resize(part, size, interpolation=cv2.INTER_CUBIC) for part in parts])


def lower_lid_sheet(character: LevelSet) -> Rgb:
    """The lower lid at rest, 1 mm up, 5 mm nasally and both: open at the left, half shut at the right."""
    columns = []
    for closure in (0.0, 0.5):
        rows = []
        for mm in ((0.0, 0.0), (1.0, 0.0), (0.0, 5.0), (1.0, 5.0)):
            up, nasal = (np.full(10, value) for value in mm)
            curve = ClipCurve(np.full(10, closure), 0, lower_vertical_mm=up, lower_horizontal_mm=nasal)
            light = character.base.astype(np.float32)
            light[character.window.slices] = FramePainter(character).light(
                curve, np.arange(10), np.full(10, 0.1)
            )
            picture = _reduced(linear_to_srgb(np.clip(light / np.float32(FULL_SCALE), 0, 1)), 2)
            rows.append(_titled(picture, f"closure {closure:g}, {mm[0]:g} mm up, {mm[1]:g} mm nasal"))
        columns.append(np.vstack(rows))
    return np.hstack(columns)


def movement_sheet(character: LevelSet, name: str) -> Rgb:
    """Brow, cheek, squint and gaze by the greatest amounts: without at the left, with at the right."""
    moved = moved_levels(character, geometry(name), Movement(brow=1.0, cheek=1.0, squint=1.0, gaze=1.0))
    columns = []
    for shown, title in (
        (character, "nothing declared"),
        (moved, "brow, cheek, squint and gaze 1 mm"),
    ):
        rows = [_reduced(shown.picture(closure), 2) for closure in (0.0, 0.5, 1.0)]
        columns.append(_titled(np.vstack(rows), title))
    return np.hstack(columns)


def blink_sheet(character: LevelSet, tall: bool) -> Rgb:
    """A model blink of 9 frames at 30 fps, without motion blur and with it, a third of actual size.

    Eyes one below the other, kinds side by side; whole faces in rows, the kinds one below the other.
    """
    kinds = []
    for blur, title in ((False, "NB: one sample per frame"), (True, "MB: mean of ten samples, linear light")):
        frames = blink_frames(character, blur)
        kinds.append(_titled(in_rows(frames, FACES_IN_A_ROW) if tall else np.vstack(frames), title))
    if tall:
        return np.vstack(kinds)
    return np.hstack([kinds[0], np.full((kinds[0].shape[0], 6, 3), 255, np.uint8), kinds[1]])


def blink_frames(character: LevelSet, blur: bool) -> list[Rgb]:
    """The blink's frames, a third of their size, from the second on."""
    shown = exemplar(RenderSettings(profile="model", duration_frames=9), "screenshot", 1, 2011)
    curve = clip_curve(shown.profile, Timing(2, 1, shown.phase_samples, 30), "none")
    painter, frames = FramePainter(character), []
    for row in frame_weights(len(curve.closure), 30, blur)[1:]:
        light = character.base.astype(np.float32)
        used = np.flatnonzero(row)
        light[character.window.slices] = painter.light(curve, used, row[used])
        frames.append(_reduced(linear_to_srgb(light / np.float32(FULL_SCALE)), 3))
    return frames


def in_rows(pictures: list[Rgb], columns: int) -> Rgb:
    """Pictures of one size from left to right and from top to bottom; white where the last row ends early."""
    blank = np.full_like(pictures[0], 255)
    filled = [*pictures, *[blank] * (-len(pictures) % columns)]
    return np.vstack([np.hstack(filled[k : k + columns]) for k in range(0, len(filled), columns)])


def profile_curves(path: Path) -> None:
    """The five profiles of Experiment 2 at 9 frames, as in the paper's Figure 8."""
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    model = default_model()
    mean = model.profile(np.zeros(model.coefficient_sd.size), "mean")
    if mean is None:
        raise SystemExit("the model's mean blink cannot be drawn")
    curves = {"model (mean)": to_full_closure(resample(mean, 9))}
    curves |= {
        kind.replace("_", " "): textbook_profile(kind, 9) for kind in ("AL_ease", "SL_ease", "AL", "SL")
    }
    for (label, profile), style in zip(curves.items(), ("-", "-", "--", "-", "--"), strict=True):
        time = np.arange(len(profile.closure)) / 10
        axes.plot(time, 1 - profile.closure, style, label=label, linewidth=2.4 if "model" in label else 1.4)
    axes.set(xlabel="frames at 30 fps", ylabel="opening (1 = open)", xlim=(0, 9), ylim=(-0.03, 1.03))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="lower right")
    drawn = BytesIO()
    figure.savefig(drawn, dpi=130)
    save(np.asarray(Image.open(drawn).convert("RGB")), path)


def save(picture: Rgb, path: Path) -> None:
    """Write a lossy WebP and say how large it is."""
    Image.fromarray(picture).save(path, "WEBP", quality=QUALITY, method=6)
    print(f"{path.name}: {path.stat().st_size // 1024} KiB")


def _reduced(picture: Rgb, times: int) -> Rgb:
    size = picture.shape[1] // times, picture.shape[0] // times
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS))


def _titled(picture: Rgb, title: str) -> Rgb:
    image = Image.new("RGB", (picture.shape[1], picture.shape[0] + 22), "white")
    image.paste(Image.fromarray(picture), (0, 22))
    ImageDraw.Draw(image).text((4, 3), title, fill="black", font=ImageFont.load_default(14))
    return np.asarray(image)


PERFORMANCE_FPS, SEED, EXEMPLAR = 30, 2011, 5
COLUMNS, CELL_PX = 11, (160, 60)
CHOSEN = (0, 1, -2)
"""The first, the second and the last but one blink."""
SETTINGS = RenderSettings(
    performance="intervals", seconds=20, state="listening", amplitude="natural", eyes="separate"
)


def performance_pictures(_: Path) -> None:
    """A performance of 20 s, frame by frame around three blinks, by two characters."""
    curve = performance_curve(SETTINGS, "", EXEMPLAR, SEED)
    print("blinks at", ", ".join(f"{one:.2f}" for one in curve.blinks_s), "s")
    starts = [int(PERFORMANCE_FPS * curve.blinks_s[index]) for index in CHOSEN]
    characters = [name for name in ("alder@8", "cartoon") if name in shipped_names()]
    painters = [FramePainter(find_character(name).levels(SIZE)) for name in characters]
    rows = []
    for start in starts:
        rows.append(numbered(range(start, start + COLUMNS)))
        rows += [strip(painter, curve, start) for painter in painters]
    save(np.vstack(rows), IMAGES / "performance-blinks.webp")


def strip(painter: FramePainter, curve: ClipCurve, start: int) -> Rgb:
    """One character's frames from `start` on, side by side."""
    windows = list(frame_windows(len(curve.closure), PERFORMANCE_FPS, True))
    cells = []
    for samples, weights in windows[start : start + COLUMNS]:
        light = painter.character.base.astype(np.float32)
        light[painter.character.window.slices] = painter.light(curve, samples, weights)
        picture = Image.fromarray(linear_to_srgb(light / np.float32(FULL_SCALE)))
        cells.append(np.asarray(picture.resize(CELL_PX, Image.Resampling.LANCZOS)))
    return np.hstack(cells)


def numbered(frames: range) -> Rgb:
    """A line with the numbers of the frames."""
    line = Image.new("RGB", (CELL_PX[0] * COLUMNS, 18), "white")
    draw, font = ImageDraw.Draw(line), ImageFont.load_default(12)
    for index, frame in enumerate(frames):
        draw.text((CELL_PX[0] * index + 4, 2), str(frame), fill="black", font=font)
    return np.asarray(line)


PARTS: dict[str, Callable[[Path], None]] = {
    "analysis": analysis_pictures,
    "participant": participant_pictures,
    "characters": character_pictures,
    "performance": performance_pictures,
    "admin": admin_pictures,
    "builder": builder_pictures,
    "recording": recording_pictures,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    chosen = parser.parse_args().parts or list(PARTS)
    if unknown := [name for name in chosen if name not in PARTS]:
        parser.error(f"expected some of {', '.join(PARTS)}, got {', '.join(unknown)}")
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        with tempfile.TemporaryDirectory() as folder:
            PARTS[name](Path(folder))
    print(f"pictures in {IMAGES.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
