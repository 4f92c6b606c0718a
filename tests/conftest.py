"""What every test may use: the folder of real recordings, where it lies beside the checkout."""

import os
from pathlib import Path

import pytest

# Most tests answer at once and without clips; those of evidence ask for refusals by their settings.
os.environ.setdefault("PALPEBRA_EVIDENCE", "record")

REPOSITORY = Path(__file__).resolve().parent.parent
# These draw on a screen and measure when: they run last, one after another, with the cores to themselves.
SCREEN_FOLDERS = ("tests/browser/", "tests/scope/")
SCREEN_MARKERS = ("browser", "firefox")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Group the tests for any number of processes: a file is a group; those of a screen are one, the last."""
    items.sort(key=on_screen)
    for item in items:
        item.add_marker(pytest.mark.xdist_group("screen" if on_screen(item) else source_file(item)))


def on_screen(item: pytest.Item) -> bool:
    """Whether a test needs a browser or a screen."""
    marked = any(item.get_closest_marker(name) is not None for name in SCREEN_MARKERS)
    return marked or source_file(item).startswith(SCREEN_FOLDERS)


def source_file(item: pytest.Item) -> str:
    """The file of a test, from the repository's root, with forward slashes."""
    return item.location[0].replace(os.sep, "/")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings beside the checkout; the test skips where it is absent."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real recordings are not here (looked for ../shared/data beside {REPOSITORY.name})")
    return folder
