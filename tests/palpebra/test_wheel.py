"""From the wheel to a rating: built, installed into an empty environment, started, used in a real browser.

The environment takes its dependencies from this one, so that nothing is fetched; Palpebra itself comes from
the wheel alone.
"""

import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from tests.conftest import REPOSITORY
from tools.build_wheel import build_demo

pytestmark = pytest.mark.browser
BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not (REPOSITORY / "frontend" / "dist" / "docs" / "index.html").is_file():
        pytest.skip("pages or docs are not built: run `make setup-test`")
    folder = tmp_path_factory.mktemp("wheel")
    if not (REPOSITORY / "palpebra" / "demo" / "manifest.json").is_file():
        build_demo()
    done = subprocess.run(
        [BIN / "python", "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the programs of an environment that holds the wheel."""
    place = tmp_path_factory.mktemp("environment") / "env"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", place], check=True)
    programs = place / "bin"
    install = [BIN / "uv", "pip", "install", "-q", "--offline", "--no-deps", "--python", programs / "python"]
    subprocess.run([*install, wheel], check=True)
    (packages,) = (place / "lib").glob("python*/site-packages")
    dependencies = packages / "dependencies.pth"
    # A line of a .pth file is a folder: this environment's packages, without its own .pth files.
    dependencies.write_text(sysconfig.get_paths()["purelib"] + "\n", encoding="utf-8")
    return programs


@pytest.fixture
def started(installed: Path, tmp_path: Path) -> Iterator[str]:
    """The address that `palpebra` opens."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "LANG": "C.UTF-8"}
    command = [installed / "palpebra", "--no-browser", "--folder", tmp_path / "data"]
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        said = []
        for line in process.stdout:
            said.append(line)
            if line.startswith("Stop with"):
                break
        addresses = [line.removeprefix("Open ").strip() for line in said if line.startswith("Open ")]
        assert addresses, "".join(said)
        yield addresses[0]
        process.terminate()


def test_wheel_holds_pages_docs_declarations_and_migrations(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    for name in (
        "palpebra/pages/admin/index.html",
        "palpebra/pages/participant/index.html",
        "palpebra/pages/docs/index.html",
        "experiments/exp1.toml",
        "migrations/env.py",
        "stimuli_builder/blinks/library/profiles.csv",
        "stimuli_builder/characters/data/alder@8/character.toml",
    ):
        assert name in names
    assert not {name for name in names if name.startswith(("tests/", "tools/", "bench/"))}


def test_first_page_leads_to_the_demo_and_a_rating(started: str, chromium: Browser) -> None:
    page = chromium.new_page(viewport={"width": 1280, "height": 800}, locale="en-US")
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.goto(started)
    expect(page.get_by_role("heading", name="Welcome to Palpebra")).to_be_visible()
    expect(page.get_by_text("Your data are in")).to_be_visible()
    demo = page.get_by_role("link", name="Take part")
    origin = started.partition("/admin")[0]
    page.goto(origin + str(demo.get_attribute("href")) + "?simulate=data-only")
    page.get_by_role("button", name="Start").click()
    page.get_by_role("checkbox").check()
    page.get_by_role("button", name="Continue").click()
    expect(page.locator("body")).not_to_contain_text("Something went wrong")
    assert complaints == []
    page.goto(f"{origin}/docs/")
    expect(page.get_by_role("heading", level=1)).to_have_text("Palpebra#")
    page.close()


def test_first_account_is_created_and_a_study_can_be_made(started: str, chromium: Browser) -> None:
    page = chromium.new_page(viewport={"width": 1280, "height": 800}, locale="en-US")
    page.goto(started)
    page.get_by_role("link", name="Create account", exact=True).click()
    page.get_by_label("User name").fill("ada")
    page.locator("input[autocomplete=new-password]").fill("lantern-orbit-velvet-92")
    page.get_by_role("button", name="Create account").click()
    expect(page.get_by_role("heading", name="New study")).to_be_visible()
    page.close()


def test_missing_extra_is_one_line_with_the_install_command(installed: Path, tmp_path: Path) -> None:
    # A module of this name is in the way of the one that the extra brings.
    (tmp_path / "skia.py").write_text("raise ModuleNotFoundError('no skia', name='skia')\n", encoding="utf-8")
    done = subprocess.run(
        [installed / "stimuli", "clip", "--character", "cartoon", "--out", "x.mp4"],
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: this command needs the extra 'render'; install Palpebra with it: ")
    assert done.stderr.endswith("uv tool install 'FILE.whl[render]'\n")


@pytest.mark.parametrize(
    "missing",
    ["palpebra/pages/admin/index.html", "migrations/versions/2026-11-22_archive.py", "server/core/db.py"],
)
def test_a_missing_file_is_one_line_and_nothing_is_created(
    installed: Path, tmp_path: Path, missing: str
) -> None:
    (packages,) = installed.parent.glob("lib/python*/site-packages")
    (packages / missing).rename(tmp_path / "away")
    try:
        for command in (["--no-browser", "--folder", tmp_path / "data"], ["doctor"]):
            done = subprocess.run(
                [installed / "palpebra", *command],
                cwd=tmp_path,
                env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "LANG": "C.UTF-8"},
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert done.returncode == 2
            assert done.stderr == (
                f"error: the installation is damaged: {missing} is missing or has another size; install "
                "Palpebra again: uv tool install --force FILE.whl\n"
            )
            assert not (tmp_path / "data").exists()
    finally:
        (tmp_path / "away").rename(packages / missing)
