"""A new user's way without TOML: twelve own clips to a live link with questionnaire and practice."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, ViewportSize, expect

from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_own_videos import shoot
from tests.browser.visit import axe_violations
from tests.helpers.tiny_clips import encoded_video

pytestmark = pytest.mark.browser
MAX_INTERACTIONS = 20
MAX_INTERACTIONS_OF_OTHERS = 25
SCREEN: ViewportSize = {"width": 1440, "height": 900}
MOST_PX = 2 * SCREEN["height"]


class Hand:
    """Somebody at the keyboard: each press and each text entered is an interaction."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.interactions = 0

    def click(self, place: Locator) -> None:
        self.interactions += 1
        place.click()

    def press(self, name: str) -> None:
        self.click(self.page.get_by_role("button", name=name))

    def fill(self, place: Locator, text: str) -> None:
        self.interactions += 1
        place.fill(text)

    def bring(self, files: list[Path]) -> None:
        """Choose files: one press for the dialog, one for the choice."""
        self.interactions += 2
        self.page.locator('input[type="file"]:not([accept=".zip"])').first.set_input_files(files)


@pytest.fixture
def clips(tmp_path: Path) -> list[Path]:
    """Twelve clips: two robots at three speeds, two clips each, with a name beyond ASCII."""
    box, paths = encoded_video(8, 30) + bytes([0, 0, 0, 9]) + b"free", []
    for robot in ("Ärmel", "rosie"):
        for speed in ("slow", "middle", "fast"):
            for number in (1, 2):
                path = tmp_path / f"{robot}_{speed}_{number}.mp4"
                path.write_bytes(box + bytes([len(paths)]))
                paths.append(path)
    return paths


def test_own_clips_to_a_live_link(dashboard: Dashboard, clips: list[Path]) -> None:
    page = dashboard.open("/")
    hand = Hand(page)
    hand.click(page.get_by_role("link", name="New study"))
    hand.fill(page.get_by_label("Short name"), "robots")
    hand.click(page.get_by_role("tab", name="From your own clips"))
    hand.bring(clips)
    page.get_by_text("12 clips uploaded").wait_for()
    # Another tab and back: the upload is still there.
    page.get_by_role("tab", name="From a definition (TOML)").click()
    page.get_by_role("tab", name="From your own clips").click()
    expect(page.get_by_text("12 clips uploaded")).to_be_visible()
    page.get_by_label("Pattern", exact=True).fill("")
    expect(page.get_by_text("a pattern with the name of a factor in braces")).to_be_visible()
    expect(page.get_by_role("button", name="Create", exact=True)).to_be_disabled()
    hand.fill(page.get_by_label("Pattern", exact=True), "{robot}_{speed}_{exemplar}.mp4")
    hand.fill(page.get_by_label("Title of the study"), "Robots")
    hand.fill(page.get_by_label("Question", exact=True), "How alive is it?")
    name = page.get_by_label("Short name")
    name.fill("short")
    page.get_by_role("button", name="Create", exact=True).click()
    expect(name).to_have_accessible_description(re.compile("A study called 'short'"))
    expect(name).to_be_focused()
    name.fill("robots")
    expect(name).to_have_accessible_description(re.compile(r"URLs and file names\.$"))
    hand.press("Create")
    page.get_by_text("robots, version 1").wait_for()

    hand.click(page.get_by_role("tab", name="Build"))
    hand.click(page.get_by_role("link", name="Practice and order"))
    hand.fill(page.get_by_label("Trials", exact=True), "3")
    hand.click(page.get_by_role("link", name="Questionnaires"))
    hand.press("Add from the question bank")
    hand.click(page.get_by_role("menuitem", name="Demographics"))
    save = page.get_by_role("button", name="Save as a new version")
    expect(save).to_be_enabled()
    hand.click(save)
    page.get_by_text("robots, version 2").wait_for()

    hand.press("Set live")
    asked = page.get_by_role("dialog")
    expect(asked.get_by_text("The analysis plan is not sealed.")).to_be_visible()
    expect(
        asked.get_by_text("Phones cannot be used: the study needs a window of at least 800 x 500 px")
    ).to_be_visible()
    confirm = asked.get_by_role("button", name="Set live")
    # Blue, as what begins something; red is for what is lost.
    red, blue = confirm.evaluate("(b) => getComputedStyle(b).backgroundColor.match(/\\d+/g)")[::2]
    assert int(blue) > int(red)
    hand.click(confirm)
    expect(page.get_by_text("Participants can start", exact=True)).to_be_visible()
    dialog = page.get_by_role("dialog")
    link = dialog.locator("code").first.inner_text()
    assert "/run/" in link
    # No recruiter is set: a link of Prolific would lead to visits without an id and a code that pays nobody.
    expect(dialog.locator("code")).to_have_count(1)
    expect(dialog.get_by_text("To recruit with Prolific, SONA or MTurk, first choose")).to_be_visible()
    assert hand.interactions <= MAX_INTERACTIONS, f"{hand.interactions} interactions"
    assert page.title() == "Build – Robots – Palpebra"

    opened = page.request.get(dashboard.server.address + link[link.index("/run/") :])
    assert opened.ok


@pytest.mark.parametrize(
    ("card", "pattern", "names"),
    [
        ("Rating on seven points", "{robot}_{speed}_{exemplar}.mp4", None),
        ("Paired comparisons", "{robot}_{speed}_{exemplar}.mp4", None),
        ("Just-noticeable", "blink_{duration}_{exemplar}.mp4", ("100", "150", "200", "250", "300", "350")),
    ],
    ids=["rating", "pairs", "threshold"],
)
def test_each_kind_of_study_is_live_within_its_interactions(
    dashboard: Dashboard, clips: list[Path], card: str, pattern: str, names: tuple[str, ...] | None
) -> None:
    if names is not None:
        places = [f"blink_{name}_{number}.mp4" for name in names for number in (1, 2)]
        clips = [clip.rename(clip.with_name(name)) for clip, name in zip(clips, places, strict=True)]
    page = dashboard.open("/")
    page.evaluate("localStorage.clear()")
    hand = Hand(page)
    study = f"study_{pattern[1:5].strip('{}_')}_{card.split()[0].lower()}"
    hand.click(page.get_by_role("link", name="New study"))
    hand.fill(page.get_by_label("Short name"), study)
    hand.bring(clips)
    page.get_by_text("12 clips uploaded").wait_for()
    hand.click(page.get_by_role("radio", name=re.compile(card)))
    hand.fill(page.get_by_label("Pattern", exact=True), pattern)
    hand.fill(page.get_by_label("Title of the study"), card)
    hand.press("Create")
    page.get_by_text(f"{study}, version 1").wait_for()
    hand.press("Set live")
    confirm = page.get_by_role("dialog").get_by_role("button", name="Set live")
    expect(confirm).to_be_enabled()
    hand.click(confirm)
    expect(page.get_by_text("Participants can start", exact=True)).to_be_visible()
    assert "/run/" in page.get_by_role("dialog").locator("code").first.inner_text()
    most = MAX_INTERACTIONS if card.startswith("Rating") else MAX_INTERACTIONS_OF_OTHERS
    assert hand.interactions <= most, f"{hand.interactions} interactions"


def test_names_that_say_nothing_lead_into_the_grid(dashboard: Dashboard, clips: list[Path]) -> None:
    clips = [clip.rename(clip.with_name(f"IMG_{4031 + number}.mp4")) for number, clip in enumerate(clips)]
    page = dashboard.open("/")
    page.evaluate("localStorage.clear()")
    hand = Hand(page)
    hand.click(page.get_by_role("link", name="New study"))
    hand.fill(page.get_by_label("Short name"), "unnamed")
    hand.bring(clips)
    page.get_by_text("12 clips uploaded").wait_for()
    expect(page.get_by_role("radio", name="In a grid")).to_be_checked()
    expect(page.get_by_text("Still needed: what varies between the clips with its levels")).to_be_visible()
    robot, speed = (page.get_by_role("group", name=f"Factor {number}") for number in (1, 2))
    hand.fill(robot.get_by_role("textbox").first, "robot type")
    hand.fill(robot.get_by_label("Its levels"), "tin, rosie")
    hand.press("Add something else that varies")
    hand.fill(speed.get_by_role("textbox").first, "speed")
    hand.fill(speed.get_by_label("Its levels"), "slow, normal, very fast")
    expect(page.get_by_text("12 places are empty")).to_be_visible()
    hand.press("Fill the grid in order of the file names")
    expect(page.locator(".grid-of-cells canvas[data-drawn]").first).to_be_visible()
    # One is in a wrong cell: it changes places with another.
    hand.click(page.get_by_role("button", name="tin/slow, no. 1: IMG_4031.mp4"))
    hand.click(page.get_by_role("button", name="rosie/very fast, no. 2: IMG_4042.mp4"))
    expect(page.get_by_role("button", name="tin/slow, no. 1: IMG_4042.mp4")).to_be_visible()
    hand.fill(page.get_by_label("Title of the study"), "Robots without names")
    assert axe_violations(page) == []
    page.set_viewport_size(SCREEN)
    assert page.evaluate("document.documentElement.scrollHeight") <= MOST_PX
    page.get_by_role("radiogroup", name="Where the levels come from").scroll_into_view_if_needed()
    shoot(dashboard, "new-grid")
    hand.press("Create")
    page.get_by_text("unnamed, version 1").wait_for()
    hand.press("Set live")
    hand.click(page.get_by_role("dialog").get_by_role("button", name="Set live"))
    expect(page.get_by_text("Participants can start", exact=True)).to_be_visible()
    assert hand.interactions <= MAX_INTERACTIONS, f"{hand.interactions} interactions"
    stored = page.request.get(f"{dashboard.server.address}/api/admin/studies/unnamed/clips").json()
    files = {f"{clip['cell']} {clip['exemplar']}": clip["file"] for clip in stored}
    assert files["tin/slow 1"] == "IMG_4042.mp4"
    assert files["tin/slow 2"] == "IMG_4032.mp4"
    assert files["rosie/very fast 2"] == "IMG_4031.mp4"


def test_a_threshold_names_the_numbers_it_lacks_before_it_is_made(
    dashboard: Dashboard, clips: list[Path]
) -> None:
    page = dashboard.open("/studies/new")
    page.evaluate("localStorage.clear()")
    page.reload()
    Hand(page).bring(clips)
    page.get_by_text("12 clips uploaded").wait_for()
    page.get_by_role("radio", name="Just-noticeable difference").click()
    page.get_by_label("Title of the study").fill("Numbers")
    lacks = page.get_by_text("a factor with at least 4 levels that are all numbers")
    expect(lacks).to_be_visible()
    expect(page.get_by_role("button", name="Create", exact=True)).to_be_disabled()
    page.get_by_role("radio", name="Rating on seven points").click()
    expect(lacks).to_have_count(0)
    page.get_by_role("button", name="Start over").click()
    Hand(page).bring(clips)
    page.get_by_text("12 clips uploaded").wait_for()
    expect(page.get_by_label("Title of the study")).to_have_value("Numbers")
    page.get_by_role("button", name="Start over").click()


def test_a_demonstration_is_built_by_a_button_and_made_a_study(dashboard: Dashboard) -> None:
    page = dashboard.open("/studies/new")
    page.get_by_role("tab", name="From a shipped experiment").click()
    panel = page.get_by_role("tabpanel", name="From a shipped experiment")
    expect(panel.get_by_role("heading", name="Demonstrations")).to_be_visible()
    expect(panel.get_by_text("stimuli build")).to_have_count(0)
    assert axe_violations(page) == []
    shoot(dashboard, "new-demos")
    panel.get_by_role("button", name="Build its clips: dcr-demo").press("Enter")
    expect(panel.get_by_role("progressbar", name="Clips of dcr-demo built")).to_be_visible()
    expect(panel.get_by_role("button", name="Build its clips: pairs-demo")).to_be_disabled()
    page.goto(f"{dashboard.server.address}/admin/")  # the build goes on without the page
    page.goto(f"{dashboard.server.address}/admin/studies/new")
    page.get_by_role("tab", name="From a shipped experiment").click()
    panel.get_by_role("button", name="Create “dcr-demo”").click(timeout=180_000)
    page.get_by_text("dcr-demo, version 1").wait_for()
    page.goto(f"{dashboard.server.address}/nothing")
    expect(page.get_by_role("heading", name="Page not found")).to_be_visible()


def test_templates_are_cards_that_the_arrow_keys_reach(dashboard: Dashboard, clips: list[Path]) -> None:
    page = dashboard.open("/studies/new")
    cards = page.get_by_role("radiogroup", name="What participants do")
    expect(cards.get_by_role("radio")).to_have_count(7)
    rating = cards.get_by_role("radio", name="Rating on seven points")
    expect(rating).to_be_checked()
    shoot(dashboard, "new-start")
    Hand(page).bring(clips)
    question = page.get_by_label("Question", exact=True)
    expect(question).to_have_value("How natural was this clip?")
    rating.focus()
    page.keyboard.press("ArrowRight")
    expect(cards.get_by_role("radio", name="Rating on a slider")).to_be_checked()
    cards.get_by_role("radio", name="Paired comparisons").click()
    expect(question).to_have_value("Which clip looked more natural?")
    expect(page.get_by_text("Two clips side by side.")).to_be_visible()
    question.fill("Which is alive?")  # one's own question stays
    cards.get_by_role("radio", name="Mean opinion score (ACR)").click()
    expect(question).to_have_value("Which is alive?")
    assert axe_violations(page) == []
    shoot(dashboard, "new-templates")
    page.get_by_role("button", name="Start over").click()
