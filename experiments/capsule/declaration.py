"""`capsule.json`: the list of a capsule's files, and what its report was made of.

A capsule is a study's data, declaration, clips and report in one zip, of which each file is known by its
hash. The list shows damage and mistakes; who changes files on purpose can write another list too, so its own
hash (`sha256`) is worth printing in the paper.
"""

import hashlib
import json
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration
from experiments.manifest import Sha256
from experiments.software import Software

CAPSULE_FILE = "capsule.json"
REPORT_FOLDER = "results"
MANIFEST = "materials/manifest.json"
"""Every clip with its hash."""
SOFTWARE_FILE = "documentation/software.json"
WRITTEN_BY_SERVER = ("methods.json", "methods.tex", "methods.txt")
"""Of the report's folder: made of the server's database, so that they are held by their hashes alone."""


class CapsuleFile(Declaration):
    """A file of the capsule."""

    path: Annotated[str, Field(min_length=1, max_length=400)]
    """From the capsule's root, parts joined by slashes."""
    bytes: Annotated[int, Field(ge=0)]
    """Its length."""
    sha256: Sha256
    """SHA-256 of its bytes."""


class ReportSource(Declaration):
    """What the report was made of: the arguments of `analysis run`."""

    definition: str
    """Path of the declaration."""
    answers: str
    """Path of the table of answers."""
    runs: str
    """Path of the table of runs."""
    origin: Literal["participant", "pilot", "simulated"]
    """Whose answers."""
    series: Annotated[int, Field(ge=1)]
    """Which data series."""
    sensitivity: bool
    """Whether the parts that take long are in it."""
    renamed: dict[str, str] = Field(default_factory=dict)
    """Factors that have another name in the table of answers, by the name that the declaration has."""
    seal: str | None = None
    """Path of the sealed plan that the report is held against; none where the plan was not sealed."""
    rebuilt: tuple[str, ...]
    """Files of the report that making it again gives."""


class Capsule(Declaration):
    """`capsule.json`."""

    format: Literal[1] = 1
    """Of this file."""
    study: str
    """Name of the study."""
    made: str
    """Day on which it was made (ISO 8601)."""
    report: ReportSource
    """What the report was made of."""
    software: Software
    """What it was made with."""
    files: Annotated[tuple[CapsuleFile, ...], Field(min_length=1)]
    """Every other file."""

    @property
    def sha256(self) -> str:
        """Hash over everything in this list: the identity of the capsule."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def text(self) -> str:
        """`capsule.json`, its own hash in it."""
        data = self.model_dump(mode="json") | {"sha256": self.sha256}
        return json.dumps(data, indent=1, ensure_ascii=False) + "\n"
