"""No module imports itself by a detour: every chain of imports ends."""

import grimp
import pytest


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph("server", exclude_type_checking_imports=True)


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


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("server.participants", "server.trials"),
        ("server.context", "server.clips"),
        ("server.errors", "server.operations"),
        ("server.views", "server.participants"),
    ],
)
def test_these_parts_import_in_one_direction_at_most(graph: grimp.ImportGraph, one: str, other: str) -> None:
    there = graph.find_shortest_chains(one, other)
    back = graph.find_shortest_chains(other, one)
    assert not (there and back), (sorted(there)[:1], sorted(back)[:1])
