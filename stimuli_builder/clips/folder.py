"""The folder of an experiment's clips: what is rendered already, its manifest, and what goes wrong in it."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Self, TextIO

import numpy as np

from experiments.declaration.experiment import Experiment
from experiments.declaration.rendering import RenderSettings
from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, Clip, Manifest, file_sha256, read_manifest
from stimuli_builder.clips.curves import Array, ClipCurve, samples_per_frame
from stimuli_builder.clips.design_clips import Options, PlannedClip

# Which inputs have been rendered to which file: how a build goes on where it stopped.

STATE_NAME = ".built.jsonl"
"""In the manifest's folder while a build runs: one line of JSON for each finished clip."""
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
        # After the manifest, since the unfinished build is the newer one.
        for built in _state_lines(folder / STATE_NAME):
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
        # Size first: it answers without reading the file.
        return path.is_file() and path.stat().st_size == built.bytes and file_sha256(path) == built.sha256

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Keep `add`ed clips on disk at once."""
        # Appended: lines of an interrupted build stay valid.
        with (self.folder / STATE_NAME).open("a", encoding="utf-8") as self._stream:
            yield
        self._stream = None

    def add(self, built: Built) -> None:
        """Note a finished clip."""
        self._built[built.input_hash] = built
        if self._stream is not None:
            self._stream.write(json.dumps(asdict(built)) + "\n")
            # At once, or an interruption would lose clips that are finished.
            self._stream.flush()

    def finish(self) -> None:
        """The manifest now says everything."""
        (self.folder / STATE_NAME).unlink(missing_ok=True)


def _state_lines(path: Path) -> Iterator[Built]:
    if not path.is_file():
        return
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            yield Built(**json.loads(line))
        except (ValueError, TypeError):
            # The line being written when the machine stopped; its clip is rendered again.
            continue


# The folder of an experiment's clips: what a former build left there, and what goes wrong in it.


def former_manifest(experiment: Experiment, folder: Path) -> Manifest | None:
    """The manifest of the build before, None where there is none; InputError where it is another study's."""
    # Before anything is rendered, which may take hours.
    if folder.exists() and not folder.is_dir():
        raise InputError(
            f"{folder}: expected a folder for the clips, but this is a file; choose another name"
        )
    if not (folder / MANIFEST_NAME).exists():
        return None
    former = read_manifest(folder)
    if former.experiment != experiment.name:
        raise InputError(
            f"{folder} has the clips of '{former.experiment}', not of '{experiment.name}'; choose another "
            "folder"
        )
    return former


def stale(former: Manifest | None, manifest: Manifest) -> tuple[str, ...]:
    """Files that a build made and the new manifest does not name; clips that came from elsewhere stay."""
    if former is None:
        return ()
    current = {clip.file for clip in manifest.files}
    # Files of a build are named by their hash; a file by another name is not ours to delete.
    made = {clip.file for clip in former.files if clip.file == f"{clip.sha256}.mp4"}
    return tuple(sorted(made - current))


@contextmanager
def readable_failures(folder: Path, state: BuildState) -> Iterator[None]:
    """Make the folder; an interruption or a full disk ends in one line that says how to go on."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except KeyboardInterrupt as error:
        raise InputError(
            f"interrupted; {state.count} clips are finished in {folder}. Run the same command to continue"
        ) from error
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written ({error.strerror or error}); {state.count} clips are finished, "
            "free disk space and run the same command again"
        ) from error


# What `manifest.json` says of each clip and of the whole set. It holds no time and no path.

CONVENTIONS = (
    "closure: 300 samples a second, 0 open, 1 closed, over the whole clip; output frame k at 30 fps is at "
    "sample 10 k + 5 and with motion blur is the mean of samples 10 k to 10 k + 9 in linear light",
    "an exemplar of a textbook profile differs from the others in its sub-frame onset; every built-in "
    "profile begins and ends with open eyes at rest (closure 0)",
)


def program_version() -> str:
    """The installed version of the program."""
    try:
        return version("palpebra")
    # Run from a source tree, without an installation.
    except PackageNotFoundError:
        return "not installed"


def assemble(
    experiment: Experiment,
    definition_hash: str,
    options: Options,
    planned: list[PlannedClip],
    state: BuildState,
) -> Manifest:
    """The manifest of a finished build, clips in design order."""
    seed = options.seed_for(experiment)
    clips = tuple(_clip(clip, state, seed) for clip in planned)
    # Rounded, since sizes differ in the last bits of a float.
    ocular = {
        round(c.geometry.inter_ocular_mm * c.geometry.px_per_mm_at(c.settings.width_px), 4) for c in planned
    }
    return Manifest(
        experiment=experiment.name,
        definition_sha256=definition_hash,
        program_version=program_version(),
        seed=seed,
        # None where characters or sizes differ.
        inter_ocular_px=ocular.pop() if len(ocular) == 1 else None,
        notes=(*CONVENTIONS, *repetition_notes(planned)),
        clips=clips,
    )


def repetition_notes(planned: list[PlannedClip]) -> tuple[str, ...]:
    """A line for each recorded profile that stands for more than one exemplar of a cell."""
    repeated = sorted({(c.job.curve.profile_id, c.spec.exemplar) for c in planned if c.repeated})
    return tuple(
        f"exemplar {number} shows the recorded profile {profile} for the second time in its cell"
        for profile, number in repeated
    )


def manifest_text(manifest: Manifest) -> str:
    """JSON with one line per clip; equal manifests give equal text."""
    content = manifest.model_dump(mode="json")
    listed = {name: content.pop(name) for name in ("clips", "checks")}
    # A study without checks keeps the manifest that it had before checks existed.
    if not listed["checks"]:
        del listed["checks"], content["checks_seed"]
    head = json.dumps(content, indent=1, ensure_ascii=False)
    lists = (f' "{name}": [\n  {_lines(clips)}\n ]' for name, clips in listed.items())
    # The head without its closing brace, which comes after the lists.
    return f"{head[:-2]},\n" + ",\n".join(lists) + "\n}\n"


def _lines(clips: list[dict[str, Any]]) -> str:
    return ",\n  ".join(json.dumps(clip, ensure_ascii=False, separators=(",", ":")) for clip in clips)


def _clip(clip: PlannedClip, state: BuildState, seed: int) -> Clip:
    job, settings, curve = clip.job, clip.settings, clip.job.curve
    built = state[job.input_hash]
    return Clip(
        levels=dict(clip.spec.levels),
        cell=clip.spec.cell,
        exemplar=clip.spec.exemplar,
        file=built.file,
        sha256=built.sha256,
        bytes=built.bytes,
        fps=settings.fps,
        frames=built.frames,
        width_px=settings.width_px,
        height_px=settings.height_px,
        width_mm=round(settings.width_px / clip.geometry.px_per_mm_at(settings.width_px), 4),
        profile=curve.profile_id,
        profile_repeated=clip.repeated,
        # A performance has many blinks and no single duration.
        duration_frames=None if settings.performance else curve.duration_frames,
        onset_frame=clip_onset_frame(curve, settings),
        closure=clip_samples(curve.closure),
        closure_other=clip_samples(curve.closure_other),
        lower_vertical_mm=clip_samples(curve.lower_vertical_mm),
        lower_horizontal_mm=clip_samples(curve.lower_horizontal_mm),
        blinks_s=curve.blinks_s,
        inputs={
            RENDER_KEY: job.input_hash,
            # The name only: a path would depend on the computer.
            "character": Path(settings.character).name,
            "character_sha256": job.look.fingerprint,
            **_shown(settings),
            "amplitude": settings.amplitude,
            # Inputs are texts, for one column each in an export.
            "motion_blur": str(settings.motion_blur).lower(),
            "lower_lid": settings.lower_lid,
            **moved_mm(clip),
            **job.look.movement.inputs(),
            # Without motion the key is left out, as in manifests from before it existed.
            **({"life": repr(settings.life), "life_seed": str(job.life_seed)} if settings.life else {}),
            **{
                name: repr(value)
                for name in ("anticipation", "settle")
                if (value := getattr(settings, name)) and not settings.performance
            },
            "eyes": settings.eyes,
            **clip.lower_held,
            "encoder": job.look.encoder,
        },
        seed=seed,
    )


def moved_mm(clip: PlannedClip) -> dict[str, str]:
    """By how many mm what is not the upper lid moves at the most: as declared, or as the bake measured it.

    The lower lid's own signals come on top of what rises with the blink; all else moves with closure.
    """
    curve, said = clip.job.curve, {}
    signals = {"lift": curve.lower_vertical_mm, "slide": curve.lower_horizontal_mm}
    for name, signal in signals.items():
        if signal is not None:
            # The value farthest from rest, with its sign.
            said[f"lower_lid_{name}_mm"] = f"{float(signal[np.argmax(np.abs(signal))]):.3f}"
    parts = dict(clip.geometry.moved_mm) | clip.job.look.movement.declared
    for name, moved in parts.items():
        said[f"{name}_mm"] = f"{moved * float(curve.closure.max()):.3f}"
    return said


def clip_samples(signal: Array | None) -> tuple[float, ...]:
    """A signal as the manifest holds it; empty where there is none."""
    return () if signal is None else tuple(signal.tolist())


def clip_onset_frame(curve: ClipCurve, settings: RenderSettings) -> int | None:
    """Where the blink begins, or the first of a performance; None where nobody blinks."""
    if settings.performance and not curve.blinks_s:
        return None
    # Rounded down: the frame that shows the onset.
    return int(curve.onset_sample / samples_per_frame(settings.fps))


def _shown(settings: RenderSettings) -> dict[str, str]:
    """What a clip shows, among its inputs: a blink of a profile, or a performance by its timing."""
    if settings.performance is None:
        return {"profile": settings.profile}
    return {"performance": settings.performance, "state": settings.state}
