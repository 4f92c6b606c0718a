"""Write the stored form and the hash of the shipped experiments, as the program of this checkout makes them.

    python -m tests.golden.definitions.make tests/golden/definitions/format_1

The files of `format_1` were written by commit c84c2e8 (with its own hash), before the
definitions had a format number; they are never written again.
"""

import json
import sys
from pathlib import Path

from experiments.load import load_experiment, locate
from experiments.schema.canonical import definition_sha256


def main(folder: Path) -> None:
    hashes = {}
    for name in ("exp1", "exp2", "exp3"):
        experiment = load_experiment(name)
        (folder / f"{name}.toml").write_bytes(locate(name).read_bytes())
        stored = json.dumps(experiment.model_dump(mode="json"), ensure_ascii=False, indent=1)
        (folder / f"{name}.json").write_text(stored + "\n", encoding="utf-8")
        hashes[name] = definition_sha256(experiment)
    (folder / "hashes.json").write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
