"""`make equal`: it finds a difference, allows a declared one, and never passes by comparing nothing."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from tools.equal.__main__ import Comparison, unused_declarations
from tools.equal.compare import (
    Declared,
    NothingToCompareError,
    compare_folders,
    declared_differences,
    first_difference,
)
from tools.equal.normalize import normalized
from tools.equal.parts import PARTS
from tools.equal.sides import PartError, Side, command

PROGRAM = """
import sys

def main():
    words = [word for word in sys.argv[1:] if word != "--help"]
    if words == ["fail"]:
        sys.exit("no such study")
    if words == ["refuse"]:
        print("no wide table", file=sys.stderr)
        sys.exit(2)
    print("Usage:", *words)
    print("Imported from", __file__)
    if not words:
        print()
        print("Commands:")
        print("  export  Write data,")
        print("          of one study.")
        print("  {command}")
"""


def small_tree(folder: Path, last: str) -> Path:
    """A tree with one program that is called like ours, with two commands."""
    (folder / "server").mkdir(parents=True)
    (folder / "server" / "__init__.py").write_text("", encoding="utf-8")
    (folder / "server" / "cli.py").write_text(PROGRAM.replace("{command}", last), encoding="utf-8")
    scripts = '[project.scripts]\nserver = "server.cli:main"\n'
    (folder / "pyproject.toml").write_text(scripts, encoding="utf-8")
    return folder


def outputs(folder: Path, **files: str) -> Path:
    """A folder of outputs; `__` in a name stands for the dot."""
    folder.mkdir()
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text, encoding="utf-8")
    return folder


def test_each_side_runs_its_own_program(tmp_path: Path) -> None:
    tree = small_tree(tmp_path / "tree", "run  Serve.")
    Side("base", tree).run({"help": str(tmp_path / "out")})
    texts = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "out").iterdir()}
    assert set(texts) == {"server.txt", "server export.txt", "server run.txt"}
    assert all(f"Imported from {tree / 'server' / 'cli.py'}" in text for text in texts.values())


def test_a_program_of_another_tree_is_refused(tmp_path: Path) -> None:
    tree = small_tree(tmp_path / "tree", "run  Serve.")
    other = small_tree(tmp_path / "other", "run  Serve.")
    (tree / "server" / "__init__.py").write_text(
        f"__path__ = [{str(other / 'server')!r}]\n", encoding="utf-8"
    )
    with pytest.raises(PartError, match=r"expected server\.cli from .*tree, it was imported from .*other"):
        Side("base", tree).run({"help": str(tmp_path / "out")})


def test_a_command_that_fails_ends_the_part(tmp_path: Path) -> None:
    tree = small_tree(tmp_path / "tree", "run  Serve.")
    with pytest.raises(PartError, match="base: server fail: ended with no such study"):
        Side("base", tree).commands(command("server", "fail"))


def test_a_refusal_is_an_output_where_one_is_expected(tmp_path: Path) -> None:
    side = Side("base", small_tree(tmp_path / "tree", "run  Serve."))
    side.commands(command("server", "refuse", refusal=tmp_path / "out" / "refused.txt"))
    assert (tmp_path / "out" / "refused.txt").read_text(encoding="utf-8") == "no wide table\n"
    with pytest.raises(PartError, match="ended with 2\nno wide table"):
        side.commands(command("server", "refuse"))


def test_a_planted_difference_is_reported_and_a_declared_one_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    base = Side("base", small_tree(tmp_path / "1", "run  Serve."))
    head = Side("head", small_tree(tmp_path / "2", "run  Serve people."))
    comparison = Comparison(base, head, tmp_path / "before", tmp_path / "after")
    (one,) = comparison.part("help", jobs=2)
    assert one.path == "help/server.txt"
    printed = capsys.readouterr().out
    assert "3 files" in printed
    assert "1 differ" in printed
    assert "-   run  Serve.\n    +   run  Serve people." in printed
    declared = [Declared("help/server.txt", "the command got a better description")]
    again = Comparison(base, head, tmp_path / "before", tmp_path / "after", declared)
    (allowed,) = again.part("help", jobs=2)
    assert allowed.reason == "the command got a better description"
    printed = capsys.readouterr().out
    assert "base  kept" in printed
    assert "equal, 1 differ as declared" in printed
    assert unused_declarations([*declared, Declared("exports/*", "none")], [allowed]) == ["exports/*"]


def test_equal_trees_are_equal(tmp_path: Path) -> None:
    sides = [Side(name, small_tree(tmp_path / name, "run  Serve.")) for name in ("base", "head")]
    assert Comparison(*sides, tmp_path / "before", tmp_path / "after").part("help", jobs=1) == []


def test_a_comparison_of_nothing_is_an_error(tmp_path: Path) -> None:
    full = outputs(tmp_path / "full", a__csv="x\n")
    (tmp_path / "none").mkdir()
    hollow = outputs(tmp_path / "hollow", a__csv="")
    for empty in (tmp_path / "none", hollow):
        for sides in ((full, empty), (empty, full), (empty, empty)):
            with pytest.raises(NothingToCompareError):
                compare_folders("exports", *sides, [Declared("*", "everything may differ")])


def test_a_file_of_one_side_alone_is_a_difference(tmp_path: Path) -> None:
    before = outputs(tmp_path / "before", a__csv="x\n", b__csv="x\n")
    after = outputs(tmp_path / "after", a__csv="x\n", c__csv="x\n")
    count, differences = compare_folders("exports", before, after, [])
    assert count == 3
    assert [(one.path, one.detail) for one in differences] == [
        ("exports/b.csv", "only in base"),
        ("exports/c.csv", "only in head"),
    ]


@pytest.mark.parametrize(
    ("after", "allowed"),
    [("scale,run\n1,a\n2,b\n", True), ("scale,run\n1,b\n2,a\n", False), ("scale,ran\n1,a\n2,b\n", False)],
)
def test_columns_in_another_order_are_the_same_cells(tmp_path: Path, after: str, allowed: bool) -> None:
    old = outputs(tmp_path / "old", csv__csv="run,scale\na,1\nb,2\n")
    new = outputs(tmp_path / "new", csv__csv=after)
    rule = Declared("exports/*.csv", "logical order of columns", "column order")
    _, (one,) = compare_folders("exports", old, new, [rule])
    assert bool(one.reason) == allowed


def test_what_is_declared_has_a_reason(tmp_path: Path) -> None:
    file = tmp_path / "declared.toml"
    file.write_text('[[difference]]\npath = "exports/*"\n', encoding="utf-8")
    with pytest.raises(ValueError, match="expected path, reason"):
        declared_differences(file)
    assert all(rule.reason for rule in declared_differences())


def test_only_times_of_this_run_and_folders_are_normalized(tmp_path: Path) -> None:
    text = f'"2026-11-21T21:27:08.9Z" "2099-11-21T21:27:08.9Z" {tmp_path}/tree/a {tmp_path}/out/b 2026'
    now = datetime(2026, 11, 29, tzinfo=UTC)
    plain = normalized("http/x.json", text.encode(), tmp_path / "out", tmp_path / "tree", now)
    assert plain.decode() == '"2026-11-21T21:27:08.9Z" "<now>" <tree>/a <out>/b 2026'


def test_the_first_difference_is_shown_where_it_is() -> None:
    long = "x" * 500
    said = first_difference(f"a\n{long}1\n".encode(), f"a\n{long}2\n".encode())
    assert said.startswith("line 2 (2 lines differ)")
    assert "x1" in said
    assert "x2" in said
    assert first_difference(b"\0abc", b"\0abd") == "4 and 4 bytes, the first that differs is 3"


def test_every_part_says_what_it_makes() -> None:
    assert all(part.__doc__ for part in PARTS.values())
