"""Attacks from outside, one file per item of docs/explanation/security-tests.md."""

import pytest

from tests.helpers.attacked import attacked  # noqa: F401 - fixture


@pytest.fixture(autouse=True)
def quick_hashes() -> None:
    """None here: what a hash costs is what some attacks are about."""
