"""The RO-Crate of a capsule (https://w3id.org/ro/crate/1.2): what each file is, who made it, and how."""

import json
import mimetypes
from collections.abc import Iterable
from typing import Any

from rocrate.model.contextentity import ContextEntity
from rocrate.model.person import Person
from rocrate.rocrate import ROCrate

from experiments.capsule.declaration import CAPSULE_FILE, CapsuleFile, ReportSource
from experiments.definition import Experiment
from experiments.software import PROGRAM, Software

CRATE_FILE = "ro-crate-metadata.json"
CRATE_VERSION = "1.2"
_FOLDERS = {
    "": "What the dataset is, for people and programs",
    "analysis": "Script that analyses the answers, or the declared plan of the analysis",
    "data": "Table of data, de-identified",
    "documentation": "Documentation of the data and the software",
    "materials": "What was shown and asked",
    "results": "Report of the analysis",
}
_NO_LICENCE = "No licence is declared: ask the creators before you use these data."


def crate_metadata(
    study: str,
    experiment: Experiment,
    files: Iterable[CapsuleFile],
    report: ReportSource,
    software: Software,
    made: str,
) -> str:
    """`ro-crate-metadata.json` of a capsule of these files."""
    crate = ROCrate(version=CRATE_VERSION)
    about = experiment.dataset
    crate.name = f"{experiment.title} (study {study})"
    crate.description = about.description or f"{experiment.title}. Data, materials and report of the study."
    crate.root_dataset["datePublished"] = made
    crate.root_dataset["license"] = _licence(crate, about.licence_page)
    crate.root_dataset["keywords"] = ["video clips", *(f.label for f in experiment.factors), *about.keywords]
    if about.creators:
        crate.root_dataset["author"] = [
            crate.add(
                Person(crate, one.orcid_page or f"#creator-{number}", _person(one.name, one.affiliation))
            )
            for number, one in enumerate(about.creators, start=1)
        ]
    by_path = {}
    for file in files:
        by_path[file.path] = crate.add_file(dest_path=file.path, properties=_of_file(file))
    listing = {"name": CAPSULE_FILE, "encodingFormat": "application/json", "description": "Hash of each file"}
    crate.add_file(dest_path=CAPSULE_FILE, properties=listing)
    _add_action(crate, by_path, report, software)
    return json.dumps(crate.metadata.generate(), indent=1, ensure_ascii=False) + "\n"


def _of_file(file: CapsuleFile) -> dict[str, Any]:
    folder, _, name = file.path.rpartition("/")
    kind = mimetypes.guess_type(file.path)[0] or {"R": "text/x-r", "toml": "application/toml"}.get(
        file.path.rpartition(".")[2], "application/octet-stream"
    )
    said = _FOLDERS.get(folder.partition("/")[0], "Part of the study")
    return {
        "name": name,
        "encodingFormat": kind,
        "contentSize": str(file.bytes),
        "sha256": file.sha256,
        "description": said,
    }


def _person(name: str, affiliation: str) -> dict[str, Any]:
    return {"name": name, **({"affiliation": affiliation} if affiliation else {})}


def _licence(crate: ROCrate, page: str | None) -> Any:
    properties = {
        "@type": "CreativeWork",
        "name": page or "No licence",
        "description": f"The licence at {page}." if page else _NO_LICENCE,
    }
    return crate.add(ContextEntity(crate, page or "#no-licence", properties=properties))


def _add_action(crate: ROCrate, by_path: dict[str, Any], report: ReportSource, software: Software) -> None:
    """How the report came about: the program, what it read, what it gave."""
    program = ContextEntity(
        crate,
        f"#{PROGRAM}",
        properties={
            "@type": "CreativeWork",
            "name": PROGRAM,
            "version": software.packages.get(PROGRAM, "unknown"),
            "description": f"Run by Python {software.python} on {software.system}; versions of "
            "all packages are in documentation/software.json",
        },
    )
    results = [entity for path, entity in by_path.items() if path.startswith("results/")]
    action = ContextEntity(
        crate,
        "#analysis",
        properties={
            "@type": "CreateAction",
            "name": f"analysis run: origin {report.origin}, data series {report.series}",
        },
    )
    crate.add(program, action)
    action["instrument"] = program
    action["object"] = [by_path[report.definition], by_path[report.answers], by_path[report.runs]]
    action["result"] = results
    crate.root_dataset["mentions"] = action
