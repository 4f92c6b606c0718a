"""Put the built pages and the documentation into the wheel; stop if they are not built.

PALPEBRA_WHEEL_WITHOUT=docs,demo leaves parts out: the container image has no use for them.
"""

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PARTS = {
    "admin": "frontend/dist/admin/index.html",
    "participant": "frontend/dist/participant/index.html",
    "docs": "frontend/dist/docs/index.html",
    "https": "deploy/Caddyfile",
    "demo": "palpebra/demo/manifest.json",
}
"""Part -> a file that is there once it is built."""


class CustomBuildHook(BuildHookInterface[Any]):
    """Adds frontend/dist as palpebra/pages."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Check the pages and include them; an editable install uses those of the checkout."""
        if version == "editable":
            return
        root = Path(self.root)
        left_out = os.environ.get("PALPEBRA_WHEEL_WITHOUT", "").split(",")
        parts = {part: file for part, file in PARTS.items() if part not in left_out}
        missing = [file for file in parts.values() if not (root / file).is_file()]
        if missing:
            said = ", ".join(missing)
            raise FileNotFoundError(
                f"expected built pages and the demo, but {said} is missing; run `make wheel`"
            )
        if "https" in parts:
            build_data["force_include"][str(root / parts["https"])] = "palpebra/Caddyfile"
        for site in sorted(parts.keys() - {"demo", "https"}):
            build_data["force_include"][str(root / "frontend" / "dist" / site)] = f"palpebra/pages/{site}"
