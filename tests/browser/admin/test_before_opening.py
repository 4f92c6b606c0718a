"""What the pages say before a study goes live, and of clips that nobody can see."""

import hashlib
import os
import re
from collections.abc import Callable
from pathlib import Path

import av
import pytest
from fastapi.testclient import TestClient
from playwright.sync_api import Page, expect

from experiments.load import parse_experiment
from experiments.manifest import Clip, Manifest
from server.app import create_app
from server.cli_common import migrated_services
from server.models import AuditEntry, Study, StudyRun
from server.studies.creation import add_version, create_study, store_clips
from tests.browser.admin.conftest import Dashboard
from tests.browser.visit import axe_violations
from tests.helpers.studies import SHORT, Participant, add_study
from tests.helpers.tiny_clips import encoded_video, make_clip_folder
from tests.server.monitor.test_failing_clips import take_part

pytestmark = pytest.mark.browser
DRAFT = SHORT.replace('"Do you agree?"', '"# [Title]\\n\\nA study on [topic]. Responsible: [name]."')
DRAFT = DRAFT.replace('name = "short"', 'name = "unfilled"')
SCREENS = {"wide": (1440, 900), "narrow": (390, 844)}


def picture(page: Page, name: str) -> None:
    """Keep the page as pictures where a folder is given: for people to look at."""
    folder = os.environ.get("PALPEBRA_TEST_PICTURES")
    if folder is None:
        return
    before = page.viewport_size
    for screen, (width, height) in SCREENS.items():
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(300)
        page.screenshot(path=Path(folder) / f"{name}-{screen}.png")
    if before is not None:
        page.set_viewport_size(before)


@pytest.fixture(scope="module")
def failing(dashboard: Dashboard, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The file of a clip that three people could not see; besides a draft whose consent is not filled in."""
    with migrated_services(dashboard.server.settings) as services:
        add_study(services, tmp_path_factory.mktemp("unfilled"), DRAFT, status="draft")
        study = add_study(services, tmp_path_factory.mktemp("broken"), SHORT, name="broken")
        with services.database.read() as session:
            version = session.query(Study).filter_by(name="broken").one().versions[0]
            clip, file = version.clips[0].clip_sha256, version.clips[0].file
    with TestClient(create_app(dashboard.server.settings)) as client:
        for _ in range(3):
            take_part(Participant(client, study.link_token), {clip})
    return file


def test_unfilled_placeholders_keep_the_study_from_going_live(dashboard: Dashboard, failing: str) -> None:
    page = dashboard.open("/studies/unfilled")
    page.get_by_role("button", name="Set live").click()
    dialog = page.get_by_role("dialog")
    fix = dialog.get_by_role("list", name="Fix first").get_by_role("listitem")
    expect(fix).to_contain_text(
        ['The text "Consent" (language en) still has placeholders to fill in: [Title]']
    )
    expect(dialog).not_to_contain_text("texts.en")
    fine = dialog.get_by_text("Completion code;")
    expect(fine).to_be_hidden()
    dialog.get_by_text(re.compile(r"^Nothing found by \d+ other checks")).click()
    expect(fine).to_be_visible()
    expect(dialog.get_by_role("button", name="Set live")).to_be_disabled()
    picture(page, "unfilled")
    dialog.get_by_role("button", name="Cancel").click()


def test_preview_and_definition_have_buttons_on_the_design_page(dashboard: Dashboard, failing: str) -> None:
    page = dashboard.open("/studies/unfilled")
    not_tried = page.get_by_role("listitem").filter(has_text="not even as a preview")
    expect(not_tried.get_by_role("button", name="Preview as a participant")).to_be_visible()
    page.get_by_role("button", name="Definition (TOML)").click()
    link = page.get_by_role("link", name="Download unfilled.toml")
    with page.expect_download() as saved:
        link.press("Enter")  # a mouse may miss it while the panel unfolds
    assert parse_experiment(saved.value.path().read_text(encoding="utf-8")).name == "unfilled"


def test_a_clip_that_nobody_can_see_is_named_on_every_page_of_its_study(
    dashboard: Dashboard, failing: str
) -> None:
    for path in ("", "/monitor"):
        page = dashboard.open(f"/studies/broken{path}")
        alarm = page.get_by_role("alert").filter(has_text="cannot be shown to participants")
        expect(alarm).to_contain_text(f"{failing}: not shown to 3 of 3 people")
        expect(alarm).to_contain_text("Decoding error")
        picture(page, f"failing{path.replace('/', '-')}")


def test_links_of_recruiters_are_offered_once_a_recruiter_is_set(dashboard: Dashboard, failing: str) -> None:
    page = dashboard.open("/studies/broken")
    page.get_by_role("button", name="Close study").click()
    page.get_by_role("dialog").get_by_role("button", name="Close study").click()
    page.get_by_role("button", name="Set live").click()
    page.get_by_role("dialog").get_by_role("button", name="Set live").click()
    opened = page.get_by_role("dialog").filter(has_text="Participants can start")
    expect(opened).to_contain_text("first choose the service under")
    expect(opened).not_to_contain_text("PROLIFIC_PID")
    picture(page, "opened")


FAULTY = DRAFT.replace('name = "unfilled"', 'name = "faulty"').replace(', de = "sehr"', "")
Content = Callable[[], bytes]


def spoiled() -> bytes:
    """A clip whose pictures are rubbish behind a sound head."""
    video = encoded_video(4, 30)
    start = video.index(b"mdat") + 4
    return video[:start] + bytes(len(video) - start)


def shown(folder: Path, brightness: tuple[int, ...], stripes: tuple[bool, ...]) -> bytes:
    """A clip of plain frames, some with stripes."""
    path = folder / f"{brightness}{stripes}.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"bf": "0", "crf": "18"})
        stream.width, stream.height, stream.pix_fmt = 256, 96, "yuv420p"
        for number, (level, striped) in enumerate(zip(brightness, stripes, strict=True)):
            frame = av.VideoFrame(256, 96, "gray")
            row = bytes(level + (60 if striped and x // 16 % 2 else 0) for x in range(256))
            frame.planes[0].update(row * 96)
            frame.pts = number
            container.mux(stream.encode(frame.reformat(format="yuv420p")))
        container.mux(stream.encode(None))
    return path.read_bytes()


@pytest.fixture(scope="module")
def faulty(dashboard: Dashboard, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The files of a draft with a fault in each of its eight clips, in the order of the faults."""
    folder = tmp_path_factory.mktemp("faulty")
    experiment = parse_experiment(FAULTY)
    manifest = make_clip_folder(experiment, folder)
    made = {
        "undecodable": (spoiled(), {}),
        "missing": (encoded_video(4, 30) + b"\0\0\0\x08free", {}),
        "different": (encoded_video(4, 30) + b"\0\0\0\x09free1", {"frames": 9}),
        "other rate": (encoded_video(4, 15), {}),
        "still": (shown(folder, (80,) * 4, (True,) * 4), {}),
        "blank": (shown(folder, (80, 90, 100, 110), (False,) * 4), {}),
        "begins blank": (shown(folder, (80,) * 4, (False, True, True, True)), {}),
        "repeated": (shown(folder, (80,) * 4, (True,) * 4), {}),
    }
    clips: list[Clip] = []
    for clip, (content, changes) in zip(manifest.clips, made.values(), strict=True):
        sha256 = hashlib.sha256(content).hexdigest()
        file = f"{sha256[:16]}.mp4"
        (folder / file).write_bytes(content)
        rest = 0.0 if clip.levels["speed"] == "slow" else 0.1
        own = {"file": file, "sha256": sha256, "bytes": len(content), "closure": (0.0, 1.0, rest)}
        clips.append(clip.model_copy(update=own | changes))
    manifest = Manifest.model_validate(manifest.model_copy(update={"clips": tuple(clips)}).model_dump())
    with migrated_services(dashboard.server.settings) as services:
        store_clips(services.clips, manifest, folder)
        with services.database.write() as session:
            study = create_study(session, experiment.name, experiment, None)
            add_version(session, study, FAULTY, experiment, manifest, None)
        services.clips.remove(clips[1].sha256)
    return [clip.file for clip in clips]


def found_by_browser(files: list[str]) -> dict[str, str]:
    """Faults that the browser finds, and what the checklist says of each; the server names the rest."""
    return {
        "a clip without motion": rf"1 clip shows no motion: {files[4]}",
        "a clip of nothing": rf"1 clip shows nothing: {files[5]}",
        "a clip that begins with nothing": rf"1 clip begins with an empty picture: {files[6]}",
        "one file in two cells": r"1 clip is the same file in several cells",
        "an unreviewed language": r"not been reviewed by a native speaker",
    }


def test_planted_faults_are_named_before_a_study_goes_live(dashboard: Dashboard, faulty: list[str]) -> None:
    page = dashboard.open("/studies/faulty")
    page.get_by_role("button", name="Set live").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_text("All clips were tried.")).to_be_visible()
    lines = dialog.get_by_role("listitem").all_inner_texts()
    faults = found_by_browser(faulty)
    missed = [name for name, words in faults.items() if not any(re.search(words, line) for line in lines)]
    assert missed == []
    # What server and browser both find has one line.
    for words in ("does not play", "is missing", "is not as stored", "plays at another rate"):
        assert len([line for line in lines if re.search(rf"1 clip {words}", line)]) == 1
    # Every fault that the server names is in the dialog; test_planted_faults.py has the list.
    checks = page.request.get(f"{dashboard.server.address}/api/admin/studies/faulty/launch-checks").json()
    assert len(checks) >= 10
    said = " ".join(lines).replace("`", "")
    assert [one["text"] for one in checks if one["text"].replace("`", "")[:80] not in said] == []
    expect(dialog.get_by_text(re.compile(r"^4 to fix before it goes live, \d+ to check"))).to_be_visible()
    expect(dialog.get_by_role("button", name="Set live")).to_be_disabled()
    picture(page, "faulty-dialog")
    # A link leads to where a fault is fixed, also from the page under the dialog.
    for _ in range(2):
        dialog.get_by_role("link", name="Build, Texts").first.click()
        expect(page).to_have_url(re.compile(r"build\?section=texts"))
        expect(dialog).to_have_count(0)
        page.get_by_role("button", name="Set live").click()
        expect(dialog.get_by_text("All clips were tried.")).to_be_visible()
    dialog.get_by_role("button", name="Cancel").click()


def test_a_study_with_a_lost_clip_is_set_live_only_by_an_explicit_override(
    dashboard: Dashboard, tmp_path: Path
) -> None:
    with migrated_services(dashboard.server.settings) as services:
        add_study(services, tmp_path, SHORT, name="lost", status="draft")
        with services.database.read() as session:
            clip = session.query(Study).filter_by(name="lost").one().versions[0].clips[0].clip_sha256
        services.clips.remove(clip)
    page = dashboard.open("/studies/lost")
    page.get_by_role("button", name="Set live").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_text("All clips were tried.")).to_be_visible()
    expect(dialog.get_by_text("1 clip is missing on the server")).to_have_count(1)
    confirm = dialog.get_by_role("button", name="Set live")
    expect(confirm).to_be_disabled()
    # Without scrolling, on the screen of most notebooks, although the checklist is longer.
    page.set_viewport_size({"width": 1280, "height": 800})
    expect(confirm).to_be_in_viewport(ratio=1)
    picture(page, "lost")
    dialog.get_by_role("checkbox", name="Set live with these clips anyway").check()
    confirm.click()
    expect(page.get_by_role("dialog").filter(has_text="Link for participants")).to_be_visible()
    with migrated_services(dashboard.server.settings) as services, services.database.read() as session:
        entry = session.query(AuditEntry).filter_by(action="status changed", target="lost").one()
        assert entry.details["anyway"] == "clip_missing"


def test_the_checklist_of_the_studys_page_leads_to_where_each_fault_is_fixed(
    dashboard: Dashboard, faulty: list[str]
) -> None:
    page = dashboard.open("/studies/faulty")
    checklist = page.get_by_role("group", name="Before it goes live")
    checklist.get_by_role("button", name="Try the clips").click()
    expect(checklist.get_by_text("All clips were tried.")).to_be_visible()
    assert axe_violations(page) == []
    picture(page, "faulty-page")
    for words, link, address in (
        ('The text "Consent"', "Build, Texts", "build?section=texts"),
        ("No limit is set", "Settings", "settings"),
        ("plan is not sealed", "Data", "data"),
        ("There is no rehearsal yet", "Rehearsal", "rehearsal"),
        ("shows no motion", "Clips", "clips"),
    ):
        line = checklist.get_by_role("listitem").filter(has_text=words).first
        expect(line.get_by_role("link", name=link)).to_have_attribute("href", re.compile(re.escape(address)))


def test_every_page_of_a_study_says_its_step_and_what_comes_next(
    dashboard: Dashboard, faulty: list[str], failing: str
) -> None:
    for path in ("", "/build", "/clips", "/links", "/settings", "/monitor"):
        page = dashboard.open(f"/studies/faulty{path}")
        steps = page.get_by_role("list", name="Steps of the study")
        expect(steps.locator("[aria-current=step]")).to_have_text("Draft")
        expect(
            page.get_by_role("link", name=re.compile(r"Fix \d problems? on the checklist\."))
        ).to_be_visible()
    page = dashboard.open("/studies/short")
    steps = page.get_by_role("list", name="Steps of the study")
    expect(steps.locator("[aria-current=step]")).to_have_text("Live")
    expect(
        page.get_by_role("link", name="Follow the participants on the monitor (3 complete).")
    ).to_be_visible()


def test_the_monitor_renews_the_header_and_says_why_a_run_is_unlikely_a_persons(
    dashboard: Dashboard, tmp_path: Path
) -> None:
    settings = dashboard.server.settings
    with migrated_services(settings) as services:
        study = add_study(services, tmp_path, SHORT, name="watched")
    page = dashboard.open("/studies/watched/monitor")
    expect(
        page.get_by_role("link", name="Follow the participants on the monitor (0 complete).")
    ).to_be_visible()
    with TestClient(create_app(settings)) as client:
        person = Participant(client, study.link_token).agree()
        person.answer_all()
        assert person.request("POST", "/complete").status_code == 200
    expect(
        page.get_by_role("link", name="Follow the participants on the monitor (1 complete).")
    ).to_be_visible()
    with migrated_services(settings) as services, services.database.write() as session:
        watched = session.query(Study).filter_by(name="watched").one()
        run = session.query(StudyRun).filter_by(study_id=watched.id)
        run.update({"evidence": "asked", "evidence_verdict": "unlikely"})
    page.reload()
    page.get_by_role("link", name="unlikely: why").click()
    verdict = page.get_by_role("group", name="A person")
    expect(verdict).to_contain_text("Answers came without valid tickets.")
    assert axe_violations(page) == []
    picture(page, "verdict")


def test_a_study_that_is_full_says_so_on_its_page_without_moving_it(
    dashboard: Dashboard, failing: str
) -> None:
    with migrated_services(dashboard.server.settings) as services, services.database.write() as session:
        session.query(Study).filter_by(name="short").update({"quota": 3})
    page = dashboard.open("/studies/short")
    page.get_by_role("tab", name="Design").wait_for()
    before = page.get_by_role("tab", name="Design").bounding_box()
    warning = page.get_by_role("status").filter(has_text="This study needs attention")
    expect(warning).to_contain_text("3 of 3 runs are complete: the study is full")
    page.wait_for_timeout(1500)
    assert page.get_by_role("tab", name="Design").bounding_box() == before
    assert axe_violations(page) == []
    picture(page, "warnings")
