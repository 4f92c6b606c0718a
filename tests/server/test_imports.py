"""No module imports itself by a detour, and every chain of imports ends after a few modules."""

import ast

import grimp
import pytest

from tests.conftest import REPOSITORY
from tools.house.graphs import longest_chain, python_graph

MAX_CHAIN = 15
"""Modules of which each imports the next; where there are more, nobody follows a call to its end."""
KNOW_EVERY_PART = {
    "app",
    "cli",
    "cli_common",
    "cli_run",
    "cli_backups",
    "request_limits",
    "web",
    "doctor",
    "drill",
    "manners",
}
"""What starts, examines or guards the whole server; all else receives the parts that it uses."""


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph("server")


def test_no_module_imports_itself_by_a_detour(graph: grimp.ImportGraph) -> None:
    """Modules are taken away whose imports have all been taken away; what is left goes round in a circle.

    Packages are more than their modules, so their own `__init__` counts as one module like others.
    """
    left = {module: set(graph.find_modules_directly_imported_by(module)) for module in graph.modules}
    while True:
        done = {module for module, imported in left.items() if not imported & left.keys()}
        if not done:
            break
        left = {module: imported for module, imported in left.items() if module not in done}
    assert sorted(left) == []


def test_the_longest_chain_of_imports_is_short() -> None:
    """As `make house` counts: every import, in functions and under TYPE_CHECKING too."""
    paths = sorted((REPOSITORY / "server").rglob("*.py"))
    trees = {path.relative_to(REPOSITORY): ast.parse(path.read_text(encoding="utf-8")) for path in paths}
    chain = longest_chain(python_graph(trees), "server")
    assert len(chain) > 5
    assert len(chain) <= MAX_CHAIN, " > ".join(" = ".join(group) for group in chain)


def test_only_endpoints_and_what_runs_the_server_know_the_whole_context(graph: grimp.ImportGraph) -> None:
    importers = graph.find_modules_that_directly_import("server.context")
    names = {module.rsplit(".", 1)[-1] for module in importers - _called(graph, "endpoints")}
    assert names <= KNOW_EVERY_PART


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("server.participation.runs", "server.participation.ratings"),
        ("server.context", "server.studies.clip_endpoints"),
        ("server.core.error_handlers", "server.operations"),
        ("server.participation.views", "server.participation.runs"),
    ],
)
def test_these_parts_import_in_one_direction_at_most(graph: grimp.ImportGraph, one: str, other: str) -> None:
    there = graph.find_shortest_chains(one, other)
    back = graph.find_shortest_chains(other, one)
    assert not (there and back), (sorted(there)[:1], sorted(back)[:1])


def _called(graph: grimp.ImportGraph, word: str) -> set[str]:
    """Modules called by this word, or ending in it: `repository` and `links_repository`."""
    names = {module: module.rsplit(".", 1)[-1] for module in graph.modules}
    return {module for module, name in names.items() if name == word or name.endswith(f"_{word}")}


def test_what_lies_behind_never_imports_what_lies_before_it(graph: grimp.ImportGraph) -> None:
    """The contracts of import-linter, for modules with longer names too."""
    endpoints, services = _called(graph, "endpoints"), _called(graph, "service")
    repositories = _called(graph, "repository")
    assert len(endpoints) > 10
    assert len(repositories) > 10
    for behind, before in ((repositories, services | endpoints), (services, endpoints)):
        for module in behind:
            known = graph.find_upstream_modules(module) & before
            assert not known, f"{module} knows {sorted(known)}"


def test_endpoints_ask_no_repository(graph: grimp.ImportGraph) -> None:
    repositories = _called(graph, "repository")
    for module in _called(graph, "endpoints"):
        asked = graph.find_modules_directly_imported_by(module) & repositories
        assert not asked, f"{module} asks {sorted(asked)}: put it into the folder's service"
