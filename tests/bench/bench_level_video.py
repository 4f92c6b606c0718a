"""Levels of `birch@6` as one video against single lossless pictures: size, loss, and time to read.

They were encoded once before, by quantiser 20; a bake alone has levels before any encoding.

`make bench`, or: python -m pytest tests/bench/bench_level_video.py -o python_files='bench_*.py' -s
"""

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from face_baking.development import psnr_db
from numpy.typing import NDArray

from stimuli_builder.characters import level_video
from stimuli_builder.characters.atlas import SHIPPED, decode_picture, load_atlas
from stimuli_builder.characters.writing import write_picture


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[NDArray[np.uint8]], float, float]:
    """Every level, the megabytes they take as lossless pictures, and the processor-seconds to read those."""
    atlas, folder = load_atlas(SHIPPED / "birch@6"), tmp_path_factory.mktemp("single")
    levels = [atlas.level_srgb(number) for number in range(len(atlas.closures))]
    files = [write_picture(folder, f"{number:03d}.webp", level) for number, level in enumerate(levels)]
    began = time.process_time()
    for file in files:
        decode_picture(folder, file, atlas.declaration.crop[2:], "level")
    seconds = time.process_time() - began
    return levels, sum((folder / file.file).stat().st_size for file in files) / 1e6, seconds


@pytest.mark.parametrize("quantiser", [13, 16, 18, 20])
def test_levels_in_a_video(
    pictures: tuple[list[NDArray[np.uint8]], float, float],
    quantiser: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    levels, megabytes, seconds = pictures
    monkeypatch.setattr(level_video, "QUANTISER", quantiser)
    level_video.write_level_video(tmp_path, "levels.mkv", levels)
    content = (tmp_path / "levels.mkv").read_bytes()
    began = time.process_time()
    frames = level_video.decode_level_video(content, "levels", "levels.mkv")
    took = time.process_time() - began
    worst = min(psnr_db(a, b) for a, b in zip(frames, levels, strict=True))
    error = max(int(np.abs(a.astype(int) - b).max()) for a, b in zip(frames, levels, strict=True))
    sys.stdout.write(
        f"\nquantiser {quantiser}: {len(content) / 1e6:.1f} MB against {megabytes:.1f} MB, "
        f"least PSNR {worst:.1f} dB, greatest error {error}; "
        f"reading takes {took / seconds:.2f} of single pictures' {seconds:.2f} s\n"
    )
