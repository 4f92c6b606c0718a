"""A study from somebody's own clips: levels from a table or from file names, then definition and manifest."""

import csv
import io
import re
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path

import tomlkit

from experiments.definition import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.manifest import Clip, Manifest, file_sha256
from experiments.schema.canonical import definition_sha256
from experiments.trials import reserved_names
from server.studies.probe import NotAFilm, probe
from server.studies.schemas import OwnClips
from server.studies.uploads import plain_name

Placed = dict[str, tuple[dict[str, str], int]]
"""File name -> (levels by factor, exemplar)."""
_FIELD = re.compile(r"\{([A-Za-z][A-Za-z0-9_]*)\}")


def levels_from_table(text: str, files: Iterable[str]) -> Placed:
    """Read levels from CSV text; each clip needs one row, each row a clip, every level a value."""
    reader = csv.DictReader(io.StringIO(text.lstrip("\ufeff")), delimiter=_delimiter(text))
    columns = [name for name in (reader.fieldnames or []) if name]
    if "file" not in columns or len(columns) < 2:
        raise InputError(
            f"expected a CSV with a column 'file' and one a factor, got {', '.join(columns) or 'none'}"
        )
    factors = [name for name in columns if name not in ("file", "exemplar")]
    known, rows = set(files), {}
    for number, row in enumerate(reader, start=2):
        name = plain_name((row["file"] or "").strip())
        if name not in known:
            raise InputError(
                f"line {number} of the table: no clip is called '{name}'{did_you_mean(name, known)}"
            )
        if name in rows:
            raise InputError(f"line {number} of the table: '{name}' stands there twice")
        levels = {factor: (row[factor] or "").strip() for factor in factors}
        if empty := [factor for factor, level in levels.items() if not level]:
            raise InputError(f"line {number} of the table: '{name}' has no level of '{empty[0]}'")
        rows[name] = (levels, (row.get("exemplar") or "").strip())
    if missing := sorted(known - set(rows)):
        raise InputError(f"{len(missing)} clips have no row in the table, the first is '{missing[0]}'")
    return _numbered(rows)


def _delimiter(text: str) -> str:
    first = text.partition("\n")[0]
    return max(",;\t", key=first.count)


def levels_from_names(pattern: str, files: Iterable[str]) -> Placed:
    """Read levels from file names by a pattern such as `{character}_{speed}_{exemplar}.mp4`."""
    fields = _FIELD.findall(pattern)
    if not [name for name in fields if name != "exemplar"] or len(set(fields)) != len(fields):
        raise InputError(
            "expected a pattern with factors in braces, each once, such as {character}_{exemplar}.mp4"
        )
    escaped = re.escape(pattern)
    for name in fields:
        escaped = escaped.replace(re.escape("{" + name + "}"), f"(?P<{name}>[^/]+?)", 1)
    matcher = re.compile(escaped)
    rows = {}
    for name in files:
        found = matcher.fullmatch(name)
        if found is None:
            raise InputError(f"the file name '{name}' does not follow the pattern {pattern}")
        levels = {field: found[field] for field in fields if field != "exemplar"}
        rows[name] = (levels, found["exemplar"] if "exemplar" in fields else "")
    return _numbered(rows)


def _numbered(rows: dict[str, tuple[dict[str, str], str]]) -> Placed:
    """Number exemplars from 1 within each cell: in the order of their marks, or of file names without any."""
    cells: dict[tuple[str, ...], list[tuple[tuple[int, str], str]]] = defaultdict(list)
    for name, (levels, mark) in rows.items():
        order = (int(mark) if mark.isdigit() else 0, mark or name)
        cells[tuple(levels.values())].append((order, name))
    placed: Placed = {}
    for members in cells.values():
        for number, (_, name) in enumerate(sorted(members), start=1):
            placed[name] = (rows[name][0], number)
    return placed


def check_factorial(placed: Placed) -> None:
    """InputError unless every combination of levels has the same number of clips."""
    if not placed:
        raise InputError("expected at least one clip, got none")
    counts = Counter(tuple(levels.values()) for levels, _ in placed.values())
    levels_of = _levels(placed)
    wanted = 1
    for levels in levels_of.values():
        wanted *= len(levels)
    if len(counts) != wanted:
        raise InputError(f"expected clips in all {wanted} cells of the design, got {len(counts)} of them")
    most, fewest = counts.most_common()[0], counts.most_common()[-1]
    if most[1] != fewest[1]:
        raise InputError(
            f"every cell needs the same number of clips: {'/'.join(most[0])} has {most[1]}, "
            f"{'/'.join(fewest[0])} has {fewest[1]}"
        )
    if reserved := [name for name in levels_of if name in reserved_names()]:
        raise InputError(
            f"a factor cannot be called '{reserved[0]}', the name of a ratings column; rename it"
        )


def _levels(placed: Placed) -> dict[str, list[str]]:
    names = next(iter(placed.values()))[0]
    return {name: sorted({levels[name] for levels, _ in placed.values()}) for name in names}


def definition_text(name: str, placed: Placed, asked: OwnClips) -> str:
    """A definition as TOML, to be edited further: one factor a column, random order, a 7-point scale."""
    check_factorial(placed)
    cells = {tuple(levels.values()) for levels, _ in placed.values()}
    document = tomlkit.document()
    document.add(
        "name", tomlkit.item(re.sub(r"[^A-Za-z0-9_]", "_", f"s_{name}" if name[0].isdigit() else name)[:40])
    )
    document.add("title", tomlkit.item(asked.title))
    factors = tomlkit.aot()
    for factor, levels in _levels(placed).items():
        table = tomlkit.table()
        table.add("name", factor)
        table.add("label", factor.replace("_", " ").capitalize())
        table.add("levels", [{"name": level, "label": level} for level in levels])
        factors.append(table)
    document.add("factors", factors)
    document.add("exemplars", tomlkit.item({"per_cell": len(placed) // len(cells)}))
    document.add("practice", tomlkit.item({"trials": min(4, len(placed))}))
    scale = {"question": {"en": asked.question}, "low": {"en": asked.low}, "high": {"en": asked.high}}
    document.add("trial", tomlkit.item({"kind": "clip_rating", "scale": scale}))
    document.add("display", tomlkit.item({"calibrate": "off"}))
    document.add("exclusions", tomlkit.item([{"rule": "incomplete"}, {"rule": "failed_plays"}]))
    document.add("texts", tomlkit.item({"en": _texts(asked)}))
    return tomlkit.dumps(document)


def _texts(asked: OwnClips) -> dict[str, str]:
    return {
        "consent": f"# {asked.title}\n\nYou will watch short clips and rate each of them. "
        "Taking part is voluntary; you can stop at any time by closing the page. "
        "Your name and internet address are not stored.\n",
        "instructions": "# What you will do\n\nPress **Space** or **Enter** to start a clip. "
        "You see it **once**. "
        f"Then answer: *{asked.question}*\n",
        "debrief": "# Thank you\n\nYour answers are stored.\n",
    }


def manifest_of(experiment: Experiment, placed: Placed, folder: Path) -> Manifest:
    """The manifest of uploaded clips; InputError for the first file that is not a film."""
    order = experiment.factor_names
    clips = []
    for name, (levels, exemplar) in sorted(placed.items()):
        if missing := [factor for factor in order if factor not in levels]:
            raise InputError(f"the clips have no levels of '{missing[0]}', a factor of the definition")
        try:
            film = probe(folder / name)
        except NotAFilm as error:
            raise InputError(f"'{name}' cannot be used: {error}") from error
        clips.append(
            Clip(
                levels={factor: levels[factor] for factor in order},
                cell="/".join(levels[factor] for factor in order),
                exemplar=exemplar,
                file=name,
                sha256=file_sha256(folder / name),
                bytes=(folder / name).stat().st_size,
                **vars(film),
            )
        )
    return Manifest(
        experiment=experiment.name,
        definition_sha256=definition_sha256(experiment),
        program_version="uploaded",
        seed=experiment.exemplars.seed,
        clips=tuple(clips),
    )
