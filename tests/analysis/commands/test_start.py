"""A command imports what it needs and no more: most of a small file's time would be imports."""

import json
import subprocess
import sys
from pathlib import Path

PROBE = """
import json, sys
from analysis.cli import app
try:
    app(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
print("LOADED " + json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))
"""


def loaded(*arguments: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", PROBE, *arguments], capture_output=True, text=True, check=True
    )
    return set(json.loads(done.stdout.rpartition("LOADED ")[2]))


def test_help_needs_no_numerics() -> None:
    assert not loaded("--help") & {"rich", "numpy", "pandas", "scipy", "sqlalchemy", "pydantic", "numba"}


def test_anova_of_a_file_needs_no_database_no_page_and_no_figure(tmp_path: Path) -> None:
    file = tmp_path / "small.csv"
    rows = [
        f"{person},{level},{person * 3 % 7 + rank * person % 5}"
        for person in range(6)
        for rank, level in enumerate("xyz")
    ]
    file.write_text("\n".join(["id,a,score", *rows]))
    modules = loaded("anova", str(file), "--participant", "id", "--rating", "score", "--within", "a")
    assert "numpy" in modules
    assert not modules & {
        "sqlalchemy",
        "jinja2",
        "matplotlib",
        "numba",
        "statsmodels",
        "pingouin",
    }
