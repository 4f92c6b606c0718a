"""What no command prints, asked of the program itself; runs inside the process of `launch.py`.

ADDRESSES is the adapter: where each name lives, the newest place first. A commit that moves one of these adds
its new address; the old one stays, as an older BASE still has it there.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ADDRESSES = {
    "KINDS": ("experiments.kinds:KINDS", "experiments.trials:KINDS"),
    "definition_sha256": ("experiments.schema.canonical:definition_sha256",),
    "editor_schema": (
        "experiments.schema.difference:editor_schema",
        "experiments.schema.editor:editor_schema",
    ),
    "load_experiment": ("experiments.load:load_experiment",),
    "load_stored": ("experiments.load:load_stored", "experiments.schema.stored:load_stored"),
    "planned_clips": ("stimuli_builder.clips.design_clips:planned_clips",),
    "ClipOptions": ("stimuli_builder.clips.design_clips:Options",),
    "reserved_names": ("experiments.kinds:reserved_names", "experiments.trials:reserved_names"),
}
PLACES = 200
"""Participants of each example whose trials are compared."""


def locate(name: str) -> Any:
    """The object of a name, from the first of its addresses that this tree has."""
    for address in ADDRESSES[name]:
        module, _, attribute = address.partition(":")
        try:
            return getattr(importlib.import_module(module), attribute)
        except (ModuleNotFoundError, AttributeError):
            continue
    raise LookupError(f"{name} is at none of {ADDRESSES[name]}: add its address to tools/equal/probes.py")


def examples(tree: Path) -> Iterator[tuple[str, Any]]:
    """The shipped experiments by name; words of motion checks are TOML too."""
    paths = (tree / "experiments").rglob("*.toml")
    for name in sorted(path.stem for path in paths if path.parent.name != "check_words"):
        yield name, locate("load_experiment")(name)


def declaration(tree: Path, out: Path) -> None:
    """The JSON schema of a declaration, names that are reserved, hashes and plain form of every example."""
    write_json(out / "schema.json", locate("editor_schema")())
    write_json(out / "reserved-names.json", sorted(locate("reserved_names")()))
    hashes = {}
    for name, experiment in examples(tree):
        hashes[name] = locate("definition_sha256")(experiment)
        write_json(out / "examples" / f"{name}.json", experiment.model_dump(mode="json"))
    for path in sorted(golden_definitions().rglob("*.json")):
        if path.name != "hashes.json":
            stored = locate("load_stored")(json.loads(path.read_text(encoding="utf-8")))
            hashes[f"{path.parent.name}/{path.stem}"] = locate("definition_sha256")(stored)
    write_json(out / "definition_sha256.json", hashes)


def golden_definitions() -> Path:
    """The stored declarations of this file's tree: both sides read the same."""
    return Path(__file__).resolve().parents[2] / "tests" / "golden" / "definitions"


def assignments(tree: Path, out: Path) -> None:
    """What each of the first places of every example is shown, one line per trial."""
    for name, experiment in examples(tree):
        assign = locate("KINDS")[experiment.trial.kind].assign
        lines = []
        for slot in range(PLACES):
            for trial in assign(experiment, experiment.exemplars.seed, slot):
                lines.append(
                    f"{slot} {json.dumps(dataclasses.asdict(trial), sort_keys=True, default=plain)}\n"
                )
        write_text(out / f"{name}.jsonl", "".join(lines))


def clip_inputs(tree: Path, out: Path) -> None:
    """Input hashes of every clip of every example."""
    for name, experiment in examples(tree):
        planned = locate("planned_clips")(experiment, locate("ClipOptions")())
        lines = [f"{number} {clip.job.input_hash} {clip.job.frames}\n" for number, clip in enumerate(planned)]
        write_text(out / f"{name}.txt", "".join(lines))


def plain(value: Any) -> Any:
    """A value that JSON lacks, as one that it has."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    return dict(value) if hasattr(value, "keys") else list(value)


def write_json(path: Path, value: Any) -> None:
    """A value as JSON, one line per leaf."""
    write_text(path, json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """A text file in a folder that is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
