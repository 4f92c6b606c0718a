"""The tiny example character, written afresh for each test."""

from pathlib import Path

import pytest

from stimuli_builder.characters.declaration import write_example_character


@pytest.fixture
def tiny_character(tmp_path: Path) -> Path:
    return write_example_character(tmp_path / "tiny")
