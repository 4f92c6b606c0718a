"""The manifest of clips that somebody brings: their shape from the file, their cells from names."""

import hashlib
import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.files import whole_file
from experiments.manifest import MADE_ELSEWHERE, MANIFEST_NAME, Clip, Manifest
from experiments.own_clips import Placed, check_factorial, check_names, one_form
from experiments.schema.canonical import definition_sha256
from stimuli_builder.characters.writing import write_bytes
from stimuli_builder.clips.manifest_file import manifest_text, program_version
from stimuli_builder.clips.own_declared import cell_of, check_against_declaration
from video_conversion.prepare import prepare
from video_conversion.prepared import VIDEO_ENDINGS, Prepared, clip_name
from video_conversion.video_file import NotAClip

MAX_NAMED = 5
CONVERTED_FOLDER = "clips"
"""Of the folder of videos: where clips go if one of them has to be converted."""
NO_DEFINITION = hashlib.sha256(b"").hexdigest()
"""Hash of the definition where none was given."""


def clip_names(folder: Path) -> list[str]:
    """Names of the videos of a folder; InputError where there are none, or two would be one clip."""
    if not folder.is_dir():
        raise InputError(f"expected a folder of videos, got {folder}, which is none")
    names = sorted(path.name for path in folder.iterdir() if path.suffix.lower() in VIDEO_ENDINGS)
    if not names:
        raise InputError(f"expected videos ({', '.join(VIDEO_ENDINGS)}) in {folder}, got none")
    check_names(clip_name(name) for name in names)
    return names


def write_own_manifest(
    folder: Path,
    placed: Placed,
    experiment: Experiment | None,
    out: Path | None = None,
    fps: float | None = None,
    report: Callable[[int], object] = lambda _done: None,
) -> tuple[Manifest, Path]:
    """Convert what browsers do not play, and write the manifest of the clips of a folder.

    Parameters
    ----------
    placed : dict
        Levels and exemplar of each video, by its name.
    experiment : Experiment or None
        The declaration whose design they are to have.
    out : Path or None
        Folder for clips and manifest. None: `folder` where every video is shown as it is, else
        `folder/clips`.
    fps : float or None
        Frames per second of every clip; None: each its own.
    report : callable
        Is told how many videos have been looked into.

    Returns
    -------
    manifest, folder : Manifest, Path
        What was written, and where.

    Raises
    ------
    InputError
        A video has no cell or cannot be a clip; nothing has been written then.
    """
    if experiment is not None:
        # First, since what is misspelt is told by what is declared; cells would only be said to lack clips.
        check_against_declaration(placed, experiment)
    check_factorial(placed)
    factors = experiment.factor_names if experiment else tuple(next(iter(placed.values()))[0])
    with TemporaryDirectory(dir=folder, prefix=".clips-") as temporary:
        prepared = _prepared(folder, sorted(placed), Path(temporary), fps, report)
        manifest = Manifest(
            experiment=experiment.name if experiment else _name_of(folder),
            definition_sha256=definition_sha256(experiment) if experiment else NO_DEFINITION,
            program_version=program_version(),
            seed=experiment.exemplars.seed if experiment else 0,
            notes=(MADE_ELSEWHERE,),
            clips=tuple(_clip(record, *placed[record.name], factors) for record in prepared),
        )
        target = out or (folder / CONVERTED_FOLDER if manifest.sources else folder)
        if target.resolve() != folder.resolve():
            _fill(target, folder, Path(temporary), prepared)
        elif manifest.sources:
            raise InputError(
                f"{len(manifest.sources)} of {len(prepared)} videos have to be converted; expected another "
                f"folder than {folder} for --out, since originals stay as they are"
            )
    write_bytes(target / MANIFEST_NAME, manifest_text(manifest).encode())
    return manifest, target


def _prepared(
    folder: Path, names: Sequence[str], made: Path, fps: float | None, report: Callable[[int], object]
) -> list[Prepared]:
    """Every video looked into, and converted into `made` where it has to be; InputError names all refused."""
    records, problems = [], []
    for done, name in enumerate(names, start=1):
        try:
            records.append(prepare(folder / name, made, fps))
        except NotAClip as error:
            problems.append(f"{name}: {error}")
        report(done)
    if problems:
        raise InputError(
            f"{len(problems)} of {len(names)} videos cannot become clips; {'; '.join(problems[:MAX_NAMED])}"
        )
    return records


def _fill(target: Path, folder: Path, made: Path, prepared: Sequence[Prepared]) -> None:
    """Clips, and originals of those that were converted, into the folder of the manifest."""
    target.mkdir(parents=True, exist_ok=True)
    for record in prepared:
        original = folder / record.name
        if record.source is None:
            _copy(original, target / one_form(record.name))
        else:
            _copy(original, target / one_form(record.source.kept_as))
            # Equal originals have one clip: it is copied for each.
            _copy(made / Path(record.clip).name, target / one_form(clip_name(record.name)))


def _copy(source: Path, target: Path) -> None:
    """A whole copy or none."""
    with whole_file(target) as temporary:
        shutil.copyfile(source, temporary)


def _name_of(folder: Path) -> str:
    return re.sub(r"\W", "_", folder.resolve().name, flags=re.ASCII)[:40]


def _clip(record: Prepared, levels: dict[str, str], exemplar: int, factors: tuple[str, ...]) -> Clip:
    return Clip(
        levels={factor: levels[factor] for factor in factors},
        cell=cell_of(levels, factors),
        exemplar=exemplar,
        file=one_form(clip_name(record.name)),
        sha256=record.sha256,
        bytes=record.bytes,
        fps=record.fps,
        frames=record.frames,
        width_px=record.width_px,
        height_px=record.height_px,
        source=record.source,
    )
