"""A kind that exists under tests/ only goes the whole way, against the real server in a separate process."""

import json
import subprocess
import sys
from pathlib import Path

from tests.conftest import REPOSITORY


def test_a_kind_in_folders_of_its_own_goes_from_declaration_to_report(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.experiments.trials.toy.whole", str(tmp_path)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    # 2 characters x 2 speeds x 2 exemplars are 8 clips: 7 pairs of neighbors each.
    assert found["rows"] == 3 * 7
    assert found["csv"] == found["database"]
    assert (found["csv"]["n"], found["csv"]["synthetic"]) == (21, True)
    assert 0 <= found["csv"]["share"] <= 1
    assert found["read_again"]
    assert found["results"] == {"kind": "other", "answers": 21}
    assert "| same |" in found["codebook"]
    assert found["psych_ds"] > 1000
    assert "report.html" in found["report"]
