"""SI and TI of pictures whose values follow from their geometry."""

from pathlib import Path

import av
import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.errors import InputError
from stimuli_builder.cli import app
from stimuli_builder.clips.preview import spatial_temporal_information


def lossless(path: Path, pictures: list[np.ndarray], pixels: str = "gray") -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.height, stream.width = pictures[0].shape
        stream.pix_fmt = pixels
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, format="gray")
            # Several threads leave whole rows of 10-bit pictures unwritten, in one run of five.
            container.mux(stream.encode(frame.reformat(format=pixels, threads=1)))
        container.mux(stream.encode())
    return path


def edge(height: int, level: int, width: int = 66) -> np.ndarray:
    """Black on the left half, `level` on the right."""
    picture = np.zeros((height, width), np.uint8)
    picture[:, width // 2 :] = level
    return picture


def test_a_single_edge_has_the_spread_of_its_two_columns(tmp_path: Path) -> None:
    path = lossless(tmp_path / "edge.mkv", [edge(34, 50)])
    # the weights 1, 2, 1 give 4 x 50 in two of the 64 inner columns, and 0 in the others
    share = 2 / 64
    si, ti = spatial_temporal_information(path)
    assert si == pytest.approx(200 * np.sqrt(share * (1 - share)))
    assert ti == 0


def test_motion_is_the_spread_of_the_largest_change(tmp_path: Path) -> None:
    flat = np.full((34, 66), 40, np.uint8)
    brighter = flat.copy()
    brighter[:, :33] += 60
    si, ti = spatial_temporal_information(lossless(tmp_path / "a.mkv", [flat, flat + 9, flat, brighter]))
    # all pixels alike: no spread; half of the pixels by 60: half of that
    assert ti == pytest.approx(30)
    assert si > 0


def test_command_lists_folders_and_writes_a_table(tmp_path: Path) -> None:
    (tmp_path / "clips").mkdir()
    for name, level in (("b.mkv", 50), ("a.mkv", 100)):
        lossless(tmp_path / "clips" / name, [edge(34, level)])
    (tmp_path / "clips" / "notes.txt").touch()
    out = tmp_path / "siti.csv"
    done = CliRunner().invoke(app, ["siti", str(tmp_path / "clips"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    lines = out.read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[0] for line in lines] == ["file", "a.mkv", "b.mkv"]
    values = [float(line.split(",")[1]) for line in lines[1:]]
    assert values[0] == pytest.approx(2 * values[1], rel=1e-3)


def test_no_video_is_one_line(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["siti", str(tmp_path)])
    assert isinstance(done.exception, InputError)
    assert "expected videos, found none in" in str(done.exception)


def test_values_do_not_depend_on_the_bits_of_the_file(tmp_path: Path) -> None:
    pictures = [edge(34, 50), edge(34, 200)]
    values = [
        spatial_temporal_information(lossless(tmp_path / f"{pixels}.mkv", pictures, pixels))
        for pixels in ("yuv420p", "yuv420p10le")
    ]
    assert values[0] == pytest.approx(values[1], rel=0.02)
