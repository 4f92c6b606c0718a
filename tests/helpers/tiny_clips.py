"""Folders of clips as `stimuli build` writes them, made in a moment: real H.264, real hashes, few pixels."""

import hashlib
import json
import tempfile
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import av
import numpy as np

from experiments import design
from experiments.assignment.order import motion_checks_by_block
from experiments.checks import CHECK_KINDS
from experiments.declaration.experiment import Experiment
from experiments.manifest import MANIFEST_NAME, CheckClip, Clip, Manifest
from experiments.schema.canonical import definition_sha256

BARCODE_CELL_PX, BARCODE_BITS = 16, 12
BOX_HEAD_BYTES = 8


def make_clip_folder(
    experiment: Experiment,
    folder: Path,
    *,
    frames: int = 4,
    fps: int = 30,
    clip_bytes: int = 0,
    size_px: tuple[int, int] = (256, 96),
    blinks_s: tuple[float, ...] = (),
) -> Manifest:
    """One playable mp4 for each clip of the design, of at least `clip_bytes`, and their manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    video, clips = encoded_video(frames, fps, *size_px), []
    for spec in design.clips(experiment):
        # A box that players skip makes each file unique, without encoding each again.
        own = f"{spec.cell}/{spec.exemplar}".encode()
        data = video + _free_box(own.ljust(clip_bytes - len(video) - BOX_HEAD_BYTES, b"."))
        sha256 = hashlib.sha256(data).hexdigest()
        file = f"{sha256[:16]}.mp4"
        (folder / file).write_bytes(data)
        clips.append(
            Clip(
                levels=dict(spec.levels),
                cell=spec.cell,
                exemplar=spec.exemplar,
                file=file,
                sha256=sha256,
                bytes=len(data),
                fps=fps,
                frames=frames,
                width_px=size_px[0],
                height_px=size_px[1],
                width_mm=120.0,
                profile=f"blink{spec.exemplar:02d}",
                blinks_s=blinks_s,
            )
        )
    manifest = Manifest(
        experiment=experiment.name,
        definition_sha256=definition_sha256(experiment),
        program_version="test",
        seed=1,
        inter_ocular_px=128.0,
        clips=tuple(clips),
        checks=_checks(experiment, folder, frames, fps),
    )
    (folder / MANIFEST_NAME).write_text(json.dumps(manifest.model_dump(mode="json")), encoding="utf-8")
    return manifest


def _checks(experiment: Experiment, folder: Path, frames: int, fps: int) -> tuple[CheckClip, ...]:
    """Clips of the declared motion checks, their answers in turn; what they show is grey."""
    declared = experiment.evidence.motion_checks
    made = []
    for number in range(1, declared.clips + 1) if any(motion_checks_by_block(experiment)) else ():
        check = declared.kinds[(number - 1) % len(declared.kinds)]
        data = encoded_video(frames, fps) + _free_box(f"{experiment.name} check {number}".encode())
        sha256 = hashlib.sha256(data).hexdigest()
        (folder / f"{sha256}.mp4").write_bytes(data)
        answer = 1 + (number * 5) % len(CHECK_KINDS[check].choices)
        shared = {"sha256": sha256, "bytes": len(data), "fps": fps, "frames": frames, "width_px": 256}
        made.append(
            CheckClip(
                check=check, number=number, answer=answer, file=f"{sha256}.mp4", height_px=96, width_mm=120.0,
                **shared,
            )
        )  # fmt: skip
    return tuple(made)


@lru_cache(maxsize=8)
def encoded_video(frames: int, fps: int, width: int = 256, height: int = 96) -> bytes:
    """A grey H.264 mp4; each frame carries its number as a barcode (white, black, bits lowest first)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        _encode(path, frames, fps, width, height)
        return path.read_bytes()


def _encode(path: Path, frames: int, fps: int, width: int, height: int) -> None:
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=fps, options={"bf": "0", "crf": "18"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.time_base = Fraction(1, fps)
        for number in range(frames):
            picture = av.VideoFrame.from_ndarray(_picture(number, width, height), format="rgb24")
            picture.pts, picture.time_base = number, Fraction(1, fps)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())


def _picture(number: int, width: int, height: int) -> np.ndarray:
    picture = np.full((height, width, 3), 128, dtype=np.uint8)
    bits = [1, 0] + [number >> bit & 1 for bit in range(BARCODE_BITS)]
    for place, bit in enumerate(bits):
        left = place * BARCODE_CELL_PX
        picture[height - BARCODE_CELL_PX :, left : left + BARCODE_CELL_PX] = 255 * bit
    return picture


def _free_box(content: bytes) -> bytes:
    return (len(content) + BOX_HEAD_BYTES).to_bytes(4, "big") + b"free" + content
