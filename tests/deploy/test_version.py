"""The version is one number, wherever it appears."""

import json
import re
import tomllib

import pytest

from tests.conftest import REPOSITORY


def read(name: str) -> str:
    return (REPOSITORY / name).read_text(encoding="utf-8")


VERSION: str = tomllib.loads(read("pyproject.toml"))["project"]["version"]


def test_the_pages_and_their_lock_file_have_it() -> None:
    locked = json.loads(read("frontend/package-lock.json"))
    assert json.loads(read("frontend/package.json"))["version"] == VERSION
    assert (locked["version"], locked["packages"][""]["version"]) == (VERSION, VERSION)


@pytest.mark.parametrize(
    ("name", "pattern"),
    [
        ("CITATION.cff", r"^version: (\S+)$"),
        ("docker-compose.yml", r"image: palpebra:(\S+)$"),
        ("packages/blender_addon/blender_addon/blender_manifest.toml", r'^version = "(.+)"$'),
        ("docs/explanation/blink-engine.md", r"palpebra_blinks-(\d+\.\d+\.\d+)\.zip"),
    ],
)
def test_other_files_have_it(name: str, pattern: str) -> None:
    assert set(re.findall(pattern, read(name), re.MULTILINE)) == {VERSION}


def test_the_changelog_begins_with_it_and_the_day_it_is_cited_by() -> None:
    headings = re.findall(r"^## (\S+)(?: \((\d{4}-\d\d-\d\d)\))?$", read("CHANGELOG.md"), re.MULTILINE)
    released = [heading for heading in headings if heading[0] != "Unreleased"]
    cited = re.findall(r"^date-released: (\S+)$", read("CITATION.cff"), re.MULTILINE)
    assert released[0] == (VERSION, cited[0])
    assert released[-1] == ("0.1.0", "2026-11-21")


def test_the_supported_version_is_the_latest() -> None:
    assert f"Only the latest version, {VERSION.rpartition('.')[0]}, gets" in read(
        "docs/explanation/security.md"
    )
