"""Study versions in memory: the declaration and the clips of a version never change, so each is read once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any, TypeVar

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.checks import CHECK_CELL, CheckName
from experiments.declaration.experiment import Experiment
from experiments.load import load_stored
from server.core.repository import clips_of_version, version_by_id
from server.participation.tallies import NumberedClip, numbers

_MAX_KEPT = 64
T = TypeVar("T")


@dataclass(frozen=True)
class PlacedClip:
    """A clip at its place in the design, with what the page needs to show it."""

    sha256: str
    frames: int
    fps: float
    bytes: int
    width_px: int
    height_px: int
    width_mm: float | None


@dataclass(frozen=True)
class CheckClip:
    """A clip of a motion check: its id, what kind of check it is, and its right answer."""

    ident: int
    check: CheckName
    answer: int


@dataclass(frozen=True)
class LoadedVersion:
    """A study version ready for use.

    Attributes
    ----------
    clips : mapping of int to PlacedClip
        Every clip by its id, those of checks too.
    places : mapping of (str, int) to int
        Finds a clip's id by cell and exemplar.
    numbered : mapping of int to NumberedClip
        A clip's number and its cell's, for tallies.
    checks : tuple of CheckClip
        The clips of motion checks.
    """

    experiment: Experiment
    inter_ocular_px: float | None
    clips: Mapping[int, PlacedClip]
    places: Mapping[tuple[str, int], int]
    numbered: Mapping[int, NumberedClip]
    checks: tuple[CheckClip, ...] = ()

    @cached_property
    def lengths(self) -> Mapping[str, float]:
        """How long each clip lasts, in ms, by its hash."""
        return {clip.sha256: 1000 * clip.frames / clip.fps for clip in self.clips.values()}

    @cached_property
    def _made(self) -> dict[Callable[["LoadedVersion"], Any], Any]:
        return {}

    def once(self, make: Callable[["LoadedVersion"], T]) -> T:
        """What `make` makes of this version, which never changes: made at its first use and kept."""
        if make not in self._made:
            self._made[make] = make(self)
        made: T = self._made[make]
        return made

    def check_of(self, clip: int) -> CheckClip:
        """The motion check that the clip with this id belongs to."""
        return next(check for check in self.checks if check.ident == clip)


class Versions:
    """Loaded versions by id, shared by the threads of a worker."""

    def __init__(self) -> None:
        self._loaded: dict[int, LoadedVersion] = {}
        self._lock = Lock()

    def get(self, source: Session | Connection, version_id: int) -> LoadedVersion:
        """The version with this id, from memory or the database."""
        # Read without the lock: a version never changes, and at worst two threads load the same one.
        version = self._loaded.get(version_id)
        if version is None:
            session = source if isinstance(source, Session) else Session(source)
            version = _load(session, version_id)
            with self._lock:
                while len(self._loaded) >= _MAX_KEPT:
                    # The first that was loaded goes first, as a dict keeps the order of insertion.
                    del self._loaded[next(iter(self._loaded))]
                self._loaded[version_id] = version
        return version


def _load(session: Session, version_id: int) -> LoadedVersion:
    version = version_by_id(session, version_id)
    clips: dict[int, PlacedClip] = {}
    places: dict[tuple[str, int], int] = {}
    for clip_id, cell, exemplar, width_mm, clip in clips_of_version(session, version_id):
        sizes = (clip.frames, clip.fps, clip.bytes, clip.width_px, clip.height_px)
        clips[clip_id] = PlacedClip(clip.sha256, *sizes, width_mm)
        places[cell, exemplar] = clip_id
    answers = {check["number"]: check for check in version.manifest.get("checks", ())}
    checks = tuple(
        CheckClip(clip, answers[number]["check"], answers[number]["answer"])
        for (cell, number), clip in places.items()
        if cell == CHECK_CELL
    )
    places = {position: clip for position, clip in places.items() if position[0] != CHECK_CELL}
    experiment = load_stored(version.definition, version.format)
    numbered = numbers([(clip, cell) for (cell, _), clip in places.items()])
    return LoadedVersion(experiment, version.inter_ocular_px, clips, places, numbered, checks)
