"""What a user installs and waits for, next to oTree and Potato in the same run."""

import pytest

from bench.harness import ROOT
from bench.installation import UnavailableError, installed_programs

MOST_MIB = 620


def test_size_and_start_next_to_other_programs(capsys: pytest.CaptureFixture[str]) -> None:
    wheels = sorted((ROOT / "dist").glob("palpebra-*.whl"))
    if not wheels:
        pytest.skip("no wheel in dist: run `make wheel`")
    try:
        programs = {row.program: row for row in installed_programs(wheels[-1])}
    except UnavailableError as error:
        pytest.skip(f"cannot be compared here: {error}")
    with capsys.disabled():
        print(*programs.values(), sep="\n")  # noqa: T201 - figures are the result
    assert programs["Palpebra"].size_mib <= MOST_MIB
    # A ratio, because the machine may be busy: Palpebra also creates its database and adds the demo.
    assert programs["Palpebra"].start_cpu_s < 4 * programs["Potato"].start_cpu_s
