"""The face kit next to the checkout, read once."""

from pathlib import Path

import pytest
from face_baking.kit import FaceKit, load_facekit

from tests.conftest import shared_data  # noqa: F401 - pytest finds the fixture here


@pytest.fixture(scope="session")
def packed_kit(shared_data: Path) -> Path:
    file = shared_data / "facekit" / "ict_facekit.npz"
    if not file.is_file():
        pytest.skip("the face kit was not found (looked for ../shared/data/facekit next to the checkout)")
    return file


@pytest.fixture(scope="session")
def kit(packed_kit: Path) -> FaceKit:
    return load_facekit(packed_kit)
