"""Attacks from outside, one file an item of docs/security.md."""

from tests.helpers.attacked import attacked  # noqa: F401 - fixture
