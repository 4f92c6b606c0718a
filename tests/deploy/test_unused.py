"""`make check` keeps functions that nothing calls out of the code."""

from pathlib import Path

from tools.check_unused import unused


def test_a_function_that_nothing_calls_is_named(tmp_path: Path) -> None:
    own, tests = tmp_path / "server", tmp_path / "tests"
    for folder in (own, tests):
        folder.mkdir()
    (own / "a.py").write_text("def called(): ...\n\n\ndef idle(): ...\n\n\ndef collect(): ...\n")
    (tests / "test_a.py").write_text("from server.a import called\n\n\ndef test_it(): called()\n")
    [line] = unused([own, tests], [own], ["collect"])
    assert line.endswith("a.py:4: function 'idle' is never called")
