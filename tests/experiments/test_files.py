"""Output that cannot be written is reported in one line, whatever the reason."""

from pathlib import Path

import pytest

from experiments.errors import InputError
from experiments.files import whole_text


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder here says it takes files and does not")
def test_a_folder_that_takes_no_files_is_reported() -> None:
    with (
        pytest.raises(InputError, match=r"x\.csv cannot be written .*; choose a different location"),
        whole_text(Path("/proc/x.csv")) as stream,
    ):
        stream.write("a")


def test_trouble_of_the_one_who_writes_stays_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), whole_text(tmp_path / "x.csv"):
        (tmp_path / "missing").read_text()
    assert list(tmp_path.iterdir()) == []
