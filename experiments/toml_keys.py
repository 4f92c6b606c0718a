"""Tell dotted keys that take seconds to read in TOML text, in one pass and before any reader gets it."""

import re

MAX_DEPTH = 32
"""Tables and lists in one another; dotted keys make tables of any depth in a few letters each."""
PART = r"""(?:[\w-]++|"(?>(?:[^"\\\n]++|\\[^\n])*)"|'[^'\n]*+')"""
"""One part of a dotted key, bare or quoted."""
_PARTS = re.compile(PART)
_DOT = r"[ \t]*+\.[ \t]*+"
# Without a way back, and the rest of an unclosed string is swallowed: each letter is looked at a few times at
# most. Groups repeat in atomic ones: Debian 12's Python 3.11.2 matches their possessive repeats wrongly.
_TOKEN = re.compile(
    r'"""(?>(?:[^"\\]++|\\.|"{1,2}+(?!"))*)(?:"{3,5}+|.*+)'
    r"|'''(?>(?:[^']++|'{1,2}+(?!'))*)(?:'{3,5}+|.*+)"
    r"|\#[^\n]*+"
    rf"|(?P<key>{PART}(?>(?:{_DOT}{PART}){{0,{MAX_DEPTH}}}))(?>(?P<beyond>{_DOT}{PART})?)"
    r"""|["'].*+""",
    re.DOTALL,
)


def has_endless_key(text: str) -> bool:
    """Whether a dotted key has more parts than tables may stand in one another.

    The time to read one grows with the square of its parts. Dots in texts and comments do not count; behind
    the first mistake of a text, where every reader stops, the answer says nothing.
    """
    return any(token["beyond"] is not None for token in _TOKEN.finditer(text))


def sum_of_cubes(text: str) -> int:
    """Of the parts of every dotted key, which is how the time grows that an editor of TOML takes."""
    keys = (token["key"] for token in _TOKEN.finditer(text))
    return sum(len(_PARTS.findall(key)) ** 3 for key in keys if key is not None and "." in key)
