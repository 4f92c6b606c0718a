"""The manifest of clips that somebody brings: their shape from the file, their cells from names."""

import hashlib
import re
from pathlib import Path

from experiments import design
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.manifest import MANIFEST_NAME, Clip, Manifest, file_sha256
from experiments.own_clips import Placed, check_factorial, check_names, one_form
from experiments.schema.canonical import definition_sha256
from stimuli_builder.characters.writing import write_bytes
from stimuli_builder.clips.manifest_file import manifest_text, program_version
from stimuli_builder.video import opened, scan_video

ENDINGS = (".mp4", ".m4v", ".mov")
NO_DEFINITION = hashlib.sha256(b"").hexdigest()
"""Hash of the definition where none was given."""


def film_names(folder: Path) -> list[str]:
    """Names of the clips of a folder; InputError where there are none, or two would be one."""
    if not folder.is_dir():
        raise InputError(f"expected a folder of clips, got {folder}, which is none")
    names = sorted(path.name for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not names:
        raise InputError(f"expected clips ({', '.join(ENDINGS)}) in {folder}, got none")
    check_names(names)
    return names


def write_own_manifest(folder: Path, placed: Placed, experiment: Experiment | None) -> Manifest:
    """Write `folder/manifest.json`; InputError for the first clip that cannot be shown or has no cell."""
    check_factorial(placed)
    factors = tuple(next(iter(placed.values()))[0])
    if experiment is not None:
        _check_factors(factors, experiment)
        factors = experiment.factor_names
    manifest = Manifest(
        experiment=experiment.name if experiment else _name_of(folder),
        definition_sha256=definition_sha256(experiment) if experiment else NO_DEFINITION,
        program_version=program_version(),
        seed=experiment.exemplars.seed if experiment else 0,
        notes=("clips made elsewhere",),
        clips=tuple(_clip(folder / name, *placed[name], factors) for name in sorted(placed)),
    )
    if experiment is not None:
        _check_cells(manifest, experiment)
    write_bytes(folder / MANIFEST_NAME, manifest_text(manifest).encode())
    return manifest


def _name_of(folder: Path) -> str:
    return re.sub(r"\W", "_", folder.resolve().name, flags=re.ASCII)[:40]


def _check_factors(factors: tuple[str, ...], experiment: Experiment) -> None:
    if set(factors) != set(experiment.factor_names):
        raise InputError(
            f"the clips have levels of {', '.join(factors)}; expected those of {experiment.name}: "
            f"{', '.join(experiment.factor_names)}"
        )


def _check_cells(manifest: Manifest, experiment: Experiment) -> None:
    declared = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    present = {(clip.cell, clip.exemplar) for clip in manifest.clips}
    for word, cells in (("is missing", declared - present), ("is not declared", present - declared)):
        if cells:
            cell, exemplar = min(cells)
            raise InputError(
                f"{len(declared)} clips are declared, {len(present)} are here: {cell}, exemplar {exemplar}, "
                f"{word}; correct the names or the declaration"
            )


def _clip(path: Path, levels: dict[str, str], exemplar: int, factors: tuple[str, ...]) -> Clip:
    with opened(path) as (_, stream):
        codec = stream.codec_context.name
    if codec != "h264":
        raise InputError(
            f"{path.name}: expected H.264, which every browser plays, got {codec}; convert it with "
            f"`ffmpeg -i {path.name} -c:v libx264 -pix_fmt yuv420p -an NEW.mp4`"
        )
    info = scan_video(path)
    return Clip(
        levels={factor: levels[factor] for factor in factors},
        cell="/".join(levels[factor] for factor in factors),
        exemplar=exemplar,
        file=one_form(path.name),
        sha256=file_sha256(path),
        bytes=path.stat().st_size,
        fps=info.fps,
        frames=info.frame_count,
        width_px=info.size_px[0],
        height_px=info.size_px[1],
    )
