"""Replace what no two runs share (folders, times, random ids) in a part's outputs: here and nowhere else.

A file is normalized where it was written, before it is compared or kept. Nothing else may be replaced: what
an entry hides, the comparison cannot see.
"""

from __future__ import annotations

import fnmatch
import re
from datetime import datetime
from pathlib import Path

SUBSTITUTIONS: tuple[tuple[str, str, str], ...] = (
    # A default that is a folder of the tree: its length decides where the line breaks.
    ("help/*.txt", r"\s*\[default:\s+/[^\]]*\]", " [default: <folder>]"),
    # Names that matplotlib draws at random for the parts of an SVG.
    ("recordings/*.html", r"\b(?:[mp]|C\d+_\d+_)[0-9a-f]{10}\b", "<id>"),
)
"""Files (from the part on), what is replaced in them, and by what."""
TIME = re.compile(rb"20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|\+00:00)")
TEMPORARY = re.compile(rb"/tmp/equal-[a-z]+-\w+|/tmp/equal-\w+")


def normalize_folder(part: str, folder: Path, tree: Path, begun: datetime) -> None:
    """Normalize every text file of a part's outputs, in place."""
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            content = path.read_bytes()
            plain = normalized(f"{part}/{path.relative_to(folder).as_posix()}", content, folder, tree, begun)
            if plain != content:
                path.write_bytes(plain)


def normalized(path: str, content: bytes, folder: Path, tree: Path, begun: datetime) -> bytes:
    """A file's content without what no two runs share; binary files stay as they are."""
    if b"\0" in content[:4096]:
        return content
    for files, pattern, instead in SUBSTITUTIONS:
        if fnmatch.fnmatch(path, files):
            content = re.sub(pattern.encode(), instead.encode(), content)
    content = content.replace(str(folder).encode(), b"<out>").replace(str(tree).encode(), b"<tree>")
    content = TEMPORARY.sub(b"<temporary>", content)

    def without_now(moment: re.Match[bytes]) -> bytes:
        """A time of data as it is; one after the start of this run is the clock's."""
        return b"<now>" if datetime.fromisoformat(moment.group().decode()) >= begun else moment.group()

    return TIME.sub(without_now, content)
