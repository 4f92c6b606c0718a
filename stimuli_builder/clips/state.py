"""Which inputs have been rendered to which file: how a build goes on where it stopped."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self, TextIO

from experiments.manifest import Manifest, file_sha256

STATE_NAME = ".built.jsonl"
"""Beside the manifest while a build runs: one line of JSON for each finished clip."""
RENDER_KEY = "render"
"""Key of the input hash in a manifest clip's `inputs`."""


@dataclass(frozen=True)
class Built:
    """A finished clip: the hash of its inputs and its file."""

    input_hash: str
    file: str
    sha256: str
    bytes: int
    frames: int


class BuildState:
    """What is finished in a folder, kept in the manifest and, during a build, in `STATE_NAME`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._built: dict[str, Built] = {}
        self._stream: TextIO | None = None

    @classmethod
    def read(cls, folder: Path, manifest: Manifest | None) -> Self:
        """What a manifest and an unfinished build left."""
        state = cls(folder)
        for clip in manifest.files if manifest else ():
            key = clip.inputs.get(RENDER_KEY)
            if key:
                state._built[key] = Built(key, clip.file, clip.sha256, clip.bytes, clip.frames)
        for built in _lines(folder / STATE_NAME):
            state._built[built.input_hash] = built
        return state

    @property
    def count(self) -> int:
        """Number of finished clips."""
        return len(self._built)

    def __getitem__(self, input_hash: str) -> Built:
        return self._built[input_hash]

    def intact(self, input_hash: str) -> bool:
        """Whether a clip with these inputs is there, its bytes unchanged."""
        built = self._built.get(input_hash)
        if built is None:
            return False
        path = self.folder / built.file
        return path.is_file() and path.stat().st_size == built.bytes and file_sha256(path) == built.sha256

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Keep `add`ed clips on disk at once."""
        with (self.folder / STATE_NAME).open("a", encoding="utf-8") as self._stream:
            yield
        self._stream = None

    def add(self, built: Built) -> None:
        """Note a finished clip."""
        self._built[built.input_hash] = built
        if self._stream is not None:
            self._stream.write(json.dumps(asdict(built)) + "\n")
            self._stream.flush()

    def finish(self) -> None:
        """The manifest now says everything."""
        (self.folder / STATE_NAME).unlink(missing_ok=True)


def _lines(path: Path) -> Iterator[Built]:
    if not path.is_file():
        return
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            yield Built(**json.loads(line))
        except (ValueError, TypeError):
            # The line being written when the machine stopped; its clip is rendered again.
            continue
