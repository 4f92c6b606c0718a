"""The manifest of clips that somebody brings: their shape from the file, their cells from names."""

import hashlib
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from difflib import SequenceMatcher
from itertools import permutations
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError, and_others, did_you_mean, nearest
from experiments.files import whole_file
from experiments.manifest import MADE_ELSEWHERE, MANIFEST_NAME, Clip, Manifest
from experiments.own_clips import FIRST_FIELD, Placed, check_factorial, check_names, levels_of, one_form
from experiments.schema.canonical import definition_sha256
from stimuli_builder.characters.declaration import write_bytes
from stimuli_builder.clips.folder import manifest_text, program_version
from video_conversion.prepare import prepare
from video_conversion.prepared import VIDEO_ENDINGS, Prepared, clip_name
from video_conversion.video_file import NotAClip

# Whether somebody's own clips are those that a declaration wants: its factors, their levels, every cell.


def check_against_declaration(placed: Placed, experiment: Experiment) -> None:
    """InputError unless clips have the factors, levels and cells that are declared, and no others.

    Factors before levels, and levels before cells: a misspelled name is reported, not the cells that it
    empties.
    """
    for check in (_factors, _levels):
        if problems := check(placed, experiment):
            raise InputError(f"{problems[0]}{and_others(len(problems) - 1)}")
    _check_cells(placed, experiment)


def _factors(placed: Placed, experiment: Experiment) -> list[str]:
    present, declared = next(iter(placed.values()), ({}, 0))[0], experiment.factor_names
    without = [name for name in declared if name not in present]
    undeclared = [
        f"factor '{name}' of the clips is not declared in {experiment.name}"
        + (did_you_mean(name, without) or f", which has {', '.join(declared)}; declare it, or remove it")
        for name in present
        if name not in declared
    ]
    return undeclared or [
        f"the clips have no levels of '{name}', a factor of {experiment.name}; add it to the pattern or the "
        "table"
        for name in without
    ]


def _levels(placed: Placed, experiment: Experiment) -> list[str]:
    """Levels that are not declared; else those that no clip has, since a slip makes one of each."""
    undeclared, unused = [], []
    for factor in experiment.factors:
        declared = [level.name for level in factor.levels]
        files = {levels[factor.name]: file for file, (levels, _) in reversed(placed.items())}
        without = [level for level in declared if level not in files]
        for level in sorted(files.keys() - set(declared)):
            near = nearest(level, declared)
            hint = f"; did you mean '{near}', which no clip has?" if near in without else ""
            hint = hint or did_you_mean(level, declared)
            undeclared.append(f"level '{level}' of {factor.name} ({files[level]}) is not declared{hint}")
        unused += [
            f"no clip has the level '{level}' of {factor.name}, which is declared" for level in without
        ]
    return undeclared or [f"{problem}; add its clips or remove it" for problem in unused]


def _check_cells(placed: Placed, experiment: Experiment) -> None:
    declared = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    factors = experiment.factor_names
    present = {(cell_of(levels, factors), exemplar) for levels, exemplar in placed.values()}
    for word, cells in (("is missing", declared - present), ("is not declared", present - declared)):
        if cells:
            cell, exemplar = min(cells)
            raise InputError(
                f"{len(declared)} clips are declared, but {len(present)} were found: {cell}, exemplar "
                f"{exemplar}, {word}; correct the names or the declaration"
            )


def cell_of(levels: dict[str, str], factors: Sequence[str]) -> str:
    """The cell of these levels, by name: one level per factor, in order."""
    return "/".join(levels[factor] for factor in factors)


MAX_NAMED = 5
CONVERTED_FOLDER = "clips"
"""In the folder of videos: where clips go if one of them has to be converted."""
NO_DEFINITION = hashlib.sha256(b"").hexdigest()
"""Hash of the definition where none was given."""


def clip_names(folder: Path) -> list[str]:
    """Names of the videos of a folder; InputError where there are none, or two would be one clip."""
    if not folder.is_dir():
        raise InputError(f"expected a folder of videos, but {folder} is not a folder")
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
        Levels and exemplar of each video, by name.
    experiment : Experiment or None
        The declaration whose design they are to have.
    out : Path or None
        Folder for clips and manifest. None: `folder` where every video is shown as it is, else
        `folder/clips`.
    fps : float or None
        Frames per second of every clip; None: each its own.
    report : callable
        Called with the number of videos examined.

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
        # First, because the declaration reveals misspelled names; otherwise cells would only be reported as
        # empty.
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
                f"{len(manifest.sources)} of {len(prepared)} videos have to be converted; choose a folder "
                f"other than {folder} for --out, because originals are not changed"
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


# What was read of the levels of somebody's own clips, and what looks like a slip in it.

ALIKE = 0.7
"""Ratio of `SequenceMatcher` from which two levels may be one, misspelt: 0.75 of slow and slwo."""
RARER = 3
"""A level is taken for a slip of another that has this many times its clips."""
MAX_SLIPS_NAMED = 8
_NUMBERED = re.compile(r"(.+?)([_\- .]?)(\d+)")


def understood(placed: Placed, pattern: str | None) -> list[str]:
    """Lines for people: each factor's levels with their clips, then what looks wrong."""
    return [*_levels_read(placed), *_slips(placed), *_numbers_in_levels(placed, pattern)]


def _counts(placed: Placed) -> dict[str, Counter[str]]:
    known = levels_of(placed)
    counts = {name: Counter(dict.fromkeys(levels, 0)) for name, levels in known.items()}
    for levels, _ in placed.values():
        for name, level in levels.items():
            counts[name][level] += 1
    return counts


def _levels_read(placed: Placed) -> Iterator[str]:
    for name, counts in _counts(placed).items():
        named = [f"{level} ({count})" for level, count in counts.items()][:MAX_SLIPS_NAMED]
        more = f" and {len(counts) - MAX_SLIPS_NAMED} more" if len(counts) > MAX_SLIPS_NAMED else ""
        yield f"levels of {name}, with their clips: {', '.join(named)}{more}"


def _slips(placed: Placed) -> Iterator[str]:
    for name, counts in _counts(placed).items():
        for rare, usual in permutations(counts, 2):
            if counts[usual] >= RARER * counts[rare] and _named_alike(rare, usual):
                file = next(file for file, (levels, _) in placed.items() if levels[name] == rare)
                yield (
                    f"'{rare}' of {name} ({file}) looks like '{usual}': correct the name if '{usual}' is "
                    "intended"
                )


def _named_alike(one: str, other: str) -> bool:
    # Levels that differ in a number, as 2ms and 20ms, are levels.
    if re.findall(r"\d+", one) != re.findall(r"\d+", other):
        return False
    return SequenceMatcher(None, one.casefold(), other.casefold()).ratio() >= ALIKE


def _numbers_in_levels(placed: Placed, pattern: str | None) -> Iterator[str]:
    """Where a pattern without `{exemplar}` took the number of each clip into a level."""
    if pattern is None or f"{{{FIRST_FIELD}}}" in pattern:
        return
    for name, counts in _counts(placed).items():
        fits = [_NUMBERED.fullmatch(level) for level in counts]
        numbered = [fit for fit in fits if fit is not None]
        bases = Counter(fit[1] for fit in numbered)
        if len(numbered) == len(counts) > len(bases) and len(bases) > 1:
            meant = pattern.replace(f"{{{name}}}", f"{{{name}}}{numbered[0][2]}{{{FIRST_FIELD}}}", 1)
            end = f"levels of {name} end in numbers ({numbered[0][0]})"
            yield f"{end}; if they number the clips, use '{meant}'"
