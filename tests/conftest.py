"""What every test may use: the folder of real recordings, if it is next to the checkout."""

import os
import tomllib
from collections.abc import Collection, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

from tests.tiers import SHORT_RUN, entry_of, is_long

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# Most tests answer at once and without clips; those of evidence ask for refusals by their settings.
os.environ.setdefault("PALPEBRA_EVIDENCE", "record")

FAILED = pytest.StashKey[bool]()

# The same examples in every run, however slow the machine: `--hypothesis-profile=default` looks for new ones.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")

REPOSITORY = Path(__file__).resolve().parent.parent
# These compare moments on a screen: they run last, one after another.
TIMED_FILES = (
    "tests/browser/participant/test_long_clips.py",
    "tests/browser/participant/test_playback.py",
    "tests/browser/participant/test_scope.py",
    "tests/browser/participant/test_sync_patch.py",
)

# Each of their tests is a piece of work by itself, of up to minutes: any process takes the next one.
SPREAD_FILES = ("tests/docs/test_commands_run.py",)

# Of the other browser files the longest, longest first: then the processes end at about the same time.
LONGEST_FILES = tuple(
    f"tests/browser/{name}.py"
    for name in (
        "participant/test_screens",
        "participant/test_flow",
        "participant/test_offline_reload",
        "participant/test_resume",
        "participant/test_gates",
        "participant/test_views",
        "admin/test_walk",
        "participant/test_devices",
        "test_playground",
        "participant/test_faults",
        "participant/test_thresholds",
        "participant/test_ways",
        "participant/test_timing_studies",
        "participant/test_screened_out",
    )
)

# More only wait for one another: each collects all tests and has a server and a browser of its own.
MOST_PROCESSES = 4

# The only tests that are run again when they fail, each with its reason.
RERUNS = {
    test["name"]: test["reruns"]
    for test in tomllib.loads((REPOSITORY / "tests" / "reruns.toml").read_text(encoding="utf-8"))["test"]
}


class FileScheduling(LoadFileScheduling):  # type: ignore[misc]
    """A file's tests run in one process, and the timed files in one, so that no two are timed at once.

    Those of `SPREAD_FILES` run wherever there is room.

    Not xdist's own groups: it writes them to `_nodeid`, which pytest 9.2 does not read.
    """

    def _split_scope(self, nodeid: str) -> str:
        path = str(super()._split_scope(nodeid))
        if path in SPREAD_FILES:
            return nodeid
        return "timed" if path in TIMED_FILES else path


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> FileScheduling:
    """For any number of processes."""
    return FileScheduling(config, log)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """For `-n auto`: one process more than processors, since tests in a browser wait half of their time."""
    return min(MOST_PROCESSES, (os.cpu_count() or 1) + 1)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """A file that is long as a whole is not even imported where long tests are left out."""
    if config.option.markexpr != SHORT_RUN or collection_path.suffix != ".py":
        return None
    return entry_of(collection_path.relative_to(REPOSITORY).as_posix()) is not None or None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Those of a screen run after the others, the timed ones last; tiers and reruns are marked."""
    items.sort(key=lambda item: rank(source_file(item)))
    for item in items:
        name = name_of_item(item)
        if is_long(name, {marker.name for marker in item.iter_markers()}, fixtures_of(item)):
            item.add_marker(pytest.mark.long)
        if name in RERUNS:
            item.add_marker(pytest.mark.flaky(reruns=RERUNS[name]))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Note on the test whether it failed, before it is taken down."""
    report = yield
    item.stash[FAILED] = report.failed or (call.when != "setup" and item.stash.get(FAILED, False))
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    """A failed test takes along all that its file and its process share: servers, databases, browsers.

    The next try, and the tests after it, begin with what they would have had to themselves.
    """
    if item.stash.get(FAILED, False):
        item.session._setupstate.teardown_exact(None)


def rank(path: str) -> tuple[bool, bool, int]:
    """By what the files are sorted: files of the same rank stay as pytest has them."""
    length = LONGEST_FILES.index(path) if path in LONGEST_FILES else len(LONGEST_FILES)
    return path in TIMED_FILES, path.startswith("tests/browser/"), length


def source_file(item: pytest.Item) -> str:
    """The file of a test, from the repository's root, with forward slashes."""
    return item.location[0].replace(os.sep, "/")


def name_of_item(item: pytest.Item) -> str:
    """`file::test` from the repository's root, with forward slashes and without parameters."""
    return f"{source_file(item)}::{item.location[2].split('[')[0].replace('.', '::')}"


def fixtures_of(item: pytest.Item) -> Collection[str]:
    """The names of the fixtures that a test asks for, by itself or through others."""
    return tuple(getattr(item, "fixturenames", ()))


@pytest.fixture(scope="session")
def chromium() -> "Iterator[Browser]":
    """A headless Chromium: the system's, or the one Playwright has installed.

    One for all folders of tests: Playwright runs once in a process.
    """
    from playwright.sync_api import sync_playwright

    from tests.browser.conftest import CHROMIUM_FLAGS, system_chromium

    found = system_chromium()
    with sync_playwright() as playwright:
        if found is None and not Path(playwright.chromium.executable_path).exists():
            pytest.skip("no Chromium here: sudo apt-get install chromium, or `playwright install chromium`")
        browser = playwright.chromium.launch(executable_path=found, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings next to the checkout; the test skips where it is absent."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real recordings are not here (looked for ../shared/data next to {REPOSITORY.name})")
    return folder
