"""Refuse functions, classes, methods and properties that nothing calls, by vulture.

What only tests call counts as called. Names that a framework calls are listed here with the one that does.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from vulture import Vulture  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parent.parent
OWN = (
    "analysis",
    "bench",
    "blink_engine",
    "experiments",
    "palpebra",
    "server",
    "packages/blender_addon/addon_build",
    "packages/blender_addon/blender_addon",
    "packages/face_baking/face_baking",
    "packages/screen_bench/screen_bench",
    "stimuli_builder",
    "tools",
    "table_files",
    "video_conversion",
)
CALLERS = (*OWN, "tests", "packages", "migrations", "frontend/scripts")
DECORATORS = [
    "@*router.*",
    "@app.*",
    "@*_app.*",
    "@*.callback*",
    "@*validator*",
    "@*serializer*",
    "@listens_for*",
]
TIMINGS = "test_*"
"""What pytest calls in the timings of `make bench`."""
CALLED_FROM_OUTSIDE = {
    "handle_starttag": "html.parser",
    "handle_endtag": "html.parser",
    "handle_data": "html.parser",
    "handleError": "logging",
    "writable": "zipfile",
    "load_dialect_impl": "SQLAlchemy",
    "process_bind_param": "SQLAlchemy",
    "process_result_value": "SQLAlchemy",
    "do_begin": "SQLAlchemy",
    "collect": "prometheus_client",
    "_gen_likelihoods": "questplus",
    "__call__": "a protocol",
    "__init_subclass__": "Python, for every subclass",
    "TicketedSubmission": "a protocol that annotations name in quotes",
    "data_url": "a template of the report",
    "create_lasting_app": "uvicorn",
    "bake_face": "an entry point of packages/face_baking",
    "bake_samples": "an entry point of packages/face_baking",
    "editor_schema": "frontend/scripts/api_types.mjs",
    "CustomBuildHook": "hatchling",
    "initialize": "hatchling",
}


def unused(
    paths: Iterable[Path], own: Sequence[Path], allowed: Iterable[str] = CALLED_FROM_OUTSIDE
) -> list[str]:
    """What is defined below `own` and called nowhere in `paths`, one line each."""
    finder = Vulture(ignore_names=[*allowed, TIMINGS], ignore_decorators=DECORATORS)
    finder.scavenge([str(path) for path in paths])
    kinds = (finder.unused_funcs, finder.unused_classes, finder.unused_methods, finder.unused_props)
    items = [item for kind in kinds for item in kind]
    mine = [item for item in items if any(Path(item.filename).resolve().is_relative_to(one) for one in own)]
    return sorted(
        f"{item.filename}:{item.first_lineno}: {item.typ} '{item.name}' is never called" for item in mine
    )


def main() -> int:
    """Print every one; 1 where there is one."""
    said = unused([ROOT / name for name in CALLERS], [ROOT / name for name in OWN])
    print("\n".join(said), end="\n" if said else "")
    return int(bool(said))


if __name__ == "__main__":
    sys.exit(main())
