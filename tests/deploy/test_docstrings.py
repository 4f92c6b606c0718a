"""`make check` refuses docstrings that numpydoc cannot read, or that are not in its format."""

import ast

import pytest

from tools.check_docstrings import faults

FUNCTION = '''
def mean(values: list[float], weight: float = 1.0) -> float:
    """The mean.

{doc}
    """
'''
FIELDS = '''
class Base:
    inherited: int


class Clip(Base):
    """A clip.

{doc}
    """

    fps: float

    def __init__(self, name: str) -> None:
        self.size = len(name)
        self.left, self.right = name, name

    @property
    def length_s(self) -> float:
        return 1.0
'''


def said(source: str, doc: str) -> str:
    indented = "\n".join("    " + line if line else line for line in doc.split("\n"))
    return "\n".join(faults("a.py", source.replace("{doc}", indented)))


@pytest.mark.parametrize(
    ("doc", "fault"),
    [
        ("values: what is averaged.", "'values: ...' belongs into a section"),
        ("Of all. `values`, `weight`: what is averaged.", "'weight: ...' belongs into a section"),
        ("Parameters\n----------\nvalues : what is averaged. Not empty.", "'values' has no type"),
        ("Parameters\n----------\nvalues", "'values' has no type"),
        (
            "Parameters\n----------\nvalues : list of float\n    weight: of each.",
            "'weight: ...' belongs into",
        ),
        ("Parameters\n----------\nvalue : float\n    One.", "'value' is not a parameter or field"),
        (
            "Parameters\n----------\nvalues: list of float\n    Some.",
            "'values: list of float' is not an entry",
        ),
        ("Parameters\n----------\nvalues : float\n\nProse after it.", "'Prose after it.' is not an entry"),
        ("Raises\n------\nInputError : where empty.", "'InputError' is not an error"),
        ("Keys\n----\nname : str", "numpydoc cannot read it: Unknown section Keys"),
        ("Returns\n-------\nint\n\nReturns\n-------\nint", "cannot read it: The section Returns"),
    ],
)
def test_a_docstring_that_is_not_numpydoc_is_refused(doc: str, fault: str) -> None:
    assert said(FUNCTION, doc).startswith("a.py:2: mean: ")
    assert fault in said(FUNCTION, doc)


def test_numpydoc_passes() -> None:
    doc = "Why: to be sure.\n\nParameters\n----------\nvalues : list of float\n    Some: any.\n"
    doc += "weight : float, optional\n\nRaises\n------\nValueError, TypeError\n    None given."
    assert said(FUNCTION, doc) == ""


def test_a_class_may_speak_of_its_fields_and_of_nothing_else() -> None:
    known = "fps, size, left, name, length_s : float"
    assert said(FIELDS, f"Attributes\n----------\n{known}") == ""
    assert "'rate' is not a parameter or field" in said(FIELDS, "Attributes\n----------\nrate : float")


def test_inherited_fields_are_known_where_their_class_is() -> None:
    source = FIELDS.replace("{doc}", "    Attributes\n    ----------\n    inherited : int")
    classes = {node.name: node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)}
    assert faults("a.py", source, classes) == []
    assert "'inherited' is not a parameter or field" in "\n".join(faults("a.py", source))


def test_a_docstring_needs_a_summary() -> None:
    source = 'def f(a: int) -> None:\n    """\n\n    Parameters\n    ----------\n    a : int\n    """\n'
    assert faults("a.py", source) == ["a.py:1: f: it has no summary"]
