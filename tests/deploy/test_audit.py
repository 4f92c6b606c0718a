"""A known weakness fails `make check`; no answer does neither fail nor pass for a good one."""

import json

import pytest

from tools.audit import npm_outcome, python_outcome

FINE = {"name": "alembic", "version": "1.20.1", "vulns": []}
WEAK = {
    "name": "pillow",
    "version": "9.0.0",
    "vulns": [{"id": "PYSEC-2023-175", "aliases": ["CVE-2023-4863"], "fix_versions": ["10.0.1"]}],
}
UNKNOWN = {"name": "anyio", "skip_reason": "Dependency not found on PyPI and could not be audited: anyio"}


def python_report(*packages: object) -> str:
    return json.dumps({"dependencies": packages, "fixes": []})


def test_a_known_weakness_is_named_with_the_version_that_fixes_it() -> None:
    outcome = python_outcome(python_report(FINE, WEAK, UNKNOWN))
    assert outcome.weak
    assert "pillow 9.0.0: PYSEC-2023-175, fixed in 10.0.1" in outcome.said


def test_none_known() -> None:
    outcome = python_outcome(python_report(FINE, UNKNOWN))
    assert not outcome.weak
    assert outcome.said == "Python: 1 packages asked about, 1 unknown to it, no weakness known"


@pytest.mark.parametrize("answer", ["", "[]", python_report(), python_report(UNKNOWN, UNKNOWN)])
def test_a_database_that_knows_no_package_has_not_answered(answer: str) -> None:
    outcome = python_outcome(answer)
    assert not outcome.weak
    assert "skipped" in outcome.said


def test_an_accepted_advisory_is_not_a_weakness(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tools.audit.ACCEPTED", {"CVE-2023-4863": "we read no WebP from strangers"})
    assert not python_outcome(python_report(WEAK)).weak


def test_npm() -> None:
    weak = npm_outcome(json.dumps({"vulnerabilities": {"minimist": {"severity": "critical"}}}))
    assert (weak.weak, "minimist: critical" in weak.said) == (True, True)
    assert npm_outcome(json.dumps({"vulnerabilities": {}})).said == "npm: no weakness known"
    refused = npm_outcome(json.dumps({"message": "405 Method Not Allowed", "error": {"summary": ""}}))
    assert (refused.weak, "skipped" in refused.said) == (False, True)
