"""The bill of materials: valid CycloneDX of every locked package, with licences that ours goes with."""

import json
import re

import pytest

from tools.sbom import NPM_LOCK, Part, bill, locked_parts, npm_parts, python_lock

PARTS = locked_parts()


def test_it_is_valid_cyclonedx_by_the_standards_own_schema() -> None:
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(bill(PARTS)) is None


def test_every_locked_package_is_in_it() -> None:
    listed = {component["purl"] for component in json.loads(bill(PARTS))["components"]}
    locked = re.findall(r"^([a-z0-9.-]+)==(\S+)(?! ;)", python_lock(), re.MULTILINE)
    here = {f"pkg:pypi/{part.name}@{part.version}" for part in PARTS if part.ecosystem == "pypi"}
    assert len(here) >= 0.9 * len(locked) > 80  # some are for other systems
    assert here <= listed
    reached = [
        place
        for place, entry in json.loads(NPM_LOCK.read_text(encoding="utf-8"))["packages"].items()
        if place.endswith("/react-dom") and not entry.get("dev")
    ]
    assert reached
    assert any(purl.startswith("pkg:npm/react-dom@") for purl in listed)


def test_every_licence_goes_with_ours() -> None:
    assert [part for part in PARTS if not part.is_compatible] == []


@pytest.mark.parametrize("licence", [None, "Proprietary", "SSPL-1.0", "GPL-2.0-only", "CC-BY-NC-4.0"])
def test_others_are_refused(licence: str | None) -> None:
    assert not Part("pypi", "x", "1", licence).is_compatible


@pytest.mark.parametrize(
    "licence", ["MIT", "BSD-3-Clause", "LGPL-3.0-only", "GPL-3.0-or-later", "(MIT OR CC0-1.0)"]
)
def test_these_are_taken(licence: str) -> None:
    assert Part("pypi", "x", "1", licence).is_compatible


def test_what_only_developers_use_is_left_out() -> None:
    lock = {"packages": {"": {}, "node_modules/a": {"version": "1", "license": "MIT"},
                         "node_modules/b": {"version": "1", "dev": True}}}  # fmt: skip
    assert [part.name for part in npm_parts(json.dumps(lock))] == ["a"]
