"""Every test is in a tier, and only named tests are run again: what the two lists name is there."""

import ast
import tomllib
from collections.abc import Iterator

import pytest

from tests import tiers
from tests.conftest import REPOSITORY, RERUNS, fixtures_of

MARKERS_GIVEN_BY_CONFTEST = {"long", "flaky"}
SHORTEST_REASON = 20
FILES = sorted((REPOSITORY / "tests").rglob("test_*.py"))


def named_tests(file: str) -> Iterator[str]:
    """`file::test` of every test of a file, also of those in classes."""
    for node in ast.parse((REPOSITORY / file).read_text(encoding="utf-8")).body:
        for inner in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef) and inner.name.startswith("test_"):
                within = f"{node.name}::" if isinstance(node, ast.ClassDef) else ""
                yield f"{file}::{within}{inner.name}"


def is_there(entry: str) -> bool:
    """Whether a folder, a file or a test is where an entry says."""
    path, _, test = entry.partition("::")
    if test:
        return (REPOSITORY / path).is_file() and entry in named_tests(path)
    return (REPOSITORY / path).is_dir() if path.endswith("/") else (REPOSITORY / path).is_file()


def test_each_entry_of_the_tiers_names_what_is_there_and_once() -> None:
    assert [entry for entry in (*tiers.LONG, *tiers.POSTGRES) if not is_there(entry)] == []
    assert all(tiers.LONG.values())
    twice = [one for one in tiers.LONG for two in tiers.LONG if one != two and below(one, two)]
    assert twice == [], "a folder or file that is long holds these already"


def below(inner: str, outer: str) -> bool:
    return tiers.is_below(outer, inner) or inner.partition("::")[0] == outer


def test_the_slice_on_postgres_asks_for_it_and_is_not_long() -> None:
    for file in tiers.POSTGRES:
        text = (REPOSITORY / file).read_text(encoding="utf-8")
        assert any(word in text for word in ("postgres", "database_url", "services", "BACKENDS", "client")), (
            file
        )
        assert tiers.entry_of(file) is None, file


@pytest.mark.parametrize(
    ("name", "markers", "fixtures", "expected"),
    [
        ("tests/server/test_pages.py::test_a", set(), (), False),
        ("tests/server/test_pages.py::test_a", {"postgres"}, (), True),
        ("tests/server/test_prepared.py::test_a", {"postgres"}, (), False),
        ("tests/server/test_durability.py::test_a", set(), (), True),
        ("tests/server/attacks/test_concurrency_limit.py::test_a", set(), (), True),
        ("tests/browser/participant/test_flow.py::test_a", {"browser"}, (), False),
        ("tests/browser/participant/test_flow.py::test_a", {"firefox"}, (), True),
        ("tests/stimuli_builder/test_a.py::test_a", set(), ("shared_data",), True),
    ],
)
def test_what_is_long(name: str, markers: set[str], fixtures: tuple[str, ...], expected: bool) -> None:
    assert tiers.is_long(name, markers, fixtures) is expected


def test_what_is_collected_here_is_marked_by_the_table(request: pytest.FixtureRequest) -> None:
    for item in request.session.items:
        name = f"{item.location[0]}::{item.location[2].partition('[')[0].replace('.', '::')}"
        markers = {marker.name for marker in item.iter_markers()}
        assert ("long" in markers) is tiers.is_long(name, markers - {"long"}, fixtures_of(item)), name
        assert ("flaky" in markers) is (name in RERUNS), name


def test_make_test_leaves_out_the_long_ones_and_make_test_all_nothing() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    recipes = {
        target: makefile.split(f"\n{target}: ")[1].split("\n\n")[0].splitlines()[1:]
        for target in ("test", "test-all")
    }
    (short,) = set(recipes["test"]) - set(recipes["test-all"])
    (everything,) = set(recipes["test-all"]) - set(recipes["test"])
    assert short.replace(f'-m "{tiers.SHORT_RUN}" ', "") == everything
    assert " -m " not in everything.partition("$(PYTEST)")[2]


def test_every_marker_is_used_and_none_of_conftest_s_is_written_by_hand() -> None:
    settings = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    declared = {marker.split(":")[0] for marker in settings["tool"]["pytest"]["ini_options"]["markers"]}
    texts = {file: file.read_text(encoding="utf-8") for file in (REPOSITORY / "tests").rglob("*.py")}
    used = {marker for marker in declared for text in texts.values() if f"pytest.mark.{marker}" in text}
    assert used == declared
    assert declared >= MARKERS_GIVEN_BY_CONFTEST
    for file in FILES:
        by_hand = [marker for marker in MARKERS_GIVEN_BY_CONFTEST if f"@pytest.mark.{marker}" in texts[file]]
        assert by_hand == [], file


def test_each_test_that_is_run_again_is_there_has_a_reason_and_a_limit() -> None:
    listed = tomllib.loads((REPOSITORY / "tests" / "reruns.toml").read_text(encoding="utf-8"))["test"]
    assert [test["name"] for test in listed if "::" not in test["name"] or not is_there(test["name"])] == []
    assert len(RERUNS) == len(listed), "a test is listed twice"
    assert all(test["reruns"] in (1, 2, 3) and len(test["reason"]) > SHORTEST_REASON for test in listed)


def test_nothing_else_runs_tests_again() -> None:
    for name in ("Makefile", "pyproject.toml", ".ci/run"):
        assert "--reruns" not in (REPOSITORY / name).read_text(encoding="utf-8")
