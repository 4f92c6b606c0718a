"""Bar-coded clips, encoded as `stimuli build` encodes, and the study that shows them."""

import hashlib
import json
from functools import cache
from pathlib import Path

from experiments import design
from experiments.declaration.trial import ClipSpec
from experiments.load import parse_experiment
from experiments.manifest import MANIFEST_NAME, Clip, Manifest
from experiments.schema.canonical import definition_sha256
from screen_bench import bars
from stimuli_builder.clips.encode import encode_clip

CLIP_S = 1.0
CLIPS_A_RUN = 10
BOX_HEAD_BYTES = 8
DECLARATION = """
name = "{name}"
title = "Bars at {fps} fps"
languages = ["en"]
[[factors]]
name = "bars"
label = "Bars"
levels = [{{ name = "a", label = "A" }}]
[exemplars]
per_cell = {per_cell}
[blocks]
repeats = {repeats}
order = "fixed"
[practice]
trials = 0
[display]
calibrate = "off"
full_screen = false
minimum_width_px = 300
minimum_height_px = 300
[playback]
max_repeats = 0
[trial]
kind = "clip_rating"
[trial.scale]
question = {{ en = "How natural?" }}
low = {{ en = "low" }}
high = {{ en = "high" }}
[texts.en]
consent = "Do you agree?"
instructions = "Look."
debrief = "Thanks."
"""


def frames_at(fps: int, seconds: float = CLIP_S) -> int:
    """How many frames a clip of that rate has."""
    return round(seconds * fps)


def declaration(name: str, fps: int, plays: int) -> str:
    """A study of at least `plays` trials, one after the other, that asks for nothing else."""
    per_cell = min(CLIPS_A_RUN, plays)
    return DECLARATION.format(name=name, fps=fps, per_cell=per_cell, repeats=-(-plays // per_cell))


def make_clip_folder(
    text: str, folder: Path, fps: int, height_px: int = bars.HEIGHT_PX, seconds: float = CLIP_S
) -> None:
    """Write the declared clips and their manifest, as `stimuli build` does."""
    experiment = parse_experiment(text)
    folder.mkdir(parents=True, exist_ok=True)
    clips = [_clip(folder, spec, fps, height_px, seconds) for spec in design.clips(experiment)]
    manifest = Manifest(
        experiment=experiment.name,
        definition_sha256=definition_sha256(experiment),
        program_version="scope",
        seed=1,
        inter_ocular_px=None,
        clips=tuple(clips),
    )
    (folder / MANIFEST_NAME).write_text(json.dumps(manifest.model_dump(mode="json")), encoding="utf-8")


def _clip(folder: Path, spec: ClipSpec, fps: int, height_px: int, seconds: float) -> Clip:
    # A box that players skip makes each file different.
    own = f"{spec.cell}/{spec.exemplar}".encode()
    data = bar_video(fps, height_px, seconds) + (len(own) + BOX_HEAD_BYTES).to_bytes(4, "big") + b"free" + own
    sha256 = hashlib.sha256(data).hexdigest()
    (folder / f"{sha256[:16]}.mp4").write_bytes(data)
    return Clip(
        levels=dict(spec.levels),
        cell=spec.cell,
        exemplar=spec.exemplar,
        file=f"{sha256[:16]}.mp4",
        sha256=sha256,
        bytes=len(data),
        fps=fps,
        frames=frames_at(fps, seconds),
        width_px=bars.WIDTH_PX,
        height_px=height_px,
        width_mm=128.0,
        profile="bars",
    )


@cache
def bar_video(fps: int, height_px: int, seconds: float) -> bytes:
    """The bars as H.264 in MP4; their numbers restart every 64 frames."""
    numbers = (number % bars.MAX_FRAMES for number in range(frames_at(fps, seconds)))
    pictures = (bars.planes(number, height_px) for number in numbers)
    return encode_clip(pictures, (bars.WIDTH_PX, height_px), fps)
