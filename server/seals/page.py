"""The sealed plan as a page that prints well."""

import json

from jinja2 import Environment, PackageLoader, StrictUndefined

from experiments.schema.canonical import canonical
from experiments.seal import Seal

TABLES = (
    "participants", "factors", "exemplars", "assignment", "groups", "blocks", "practice", "trial",
    "attention", "playback", "screening", "exclusions", "analysis", "forms", "display",
)  # fmt: skip


def page(seal: Seal) -> str:
    """HTML without scripts or anything from elsewhere."""
    declared = canonical(seal.experiment, frozenset(), {})
    parts = [(key, _text(declared[key])) for key in TABLES if key in declared]
    environment = Environment(
        loader=PackageLoader("server", "seals"), autoescape=True, undefined=StrictUndefined
    )
    template = environment.get_template("seal.html.j2")
    return template.render(
        seal=seal, title=seal.experiment.title, parts=parts, power=_text(seal.power) if seal.power else ""
    )


def _text(value: object) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False)
