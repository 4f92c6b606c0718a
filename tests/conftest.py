"""What every test may use: the folder of real recordings, where it lies beside the checkout."""

import os
from pathlib import Path

import pytest

# Most tests answer at once and without clips; those of evidence ask for refusals by their settings.
os.environ.setdefault("PALPEBRA_EVIDENCE", "record")

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings beside the checkout; the test skips where it is absent."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real recordings are not here (looked for ../shared/data beside {REPOSITORY.name})")
    return folder
