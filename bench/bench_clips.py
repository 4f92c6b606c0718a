"""Clips: CPU and wall time per clip, all 600 by extrapolation, worst midpoint, opening, memory.

`make bench`, or: python -m pytest bench/bench_clips.py -o python_files='bench_*.py' -s

And reading a shipped face: memory at the most against what stays, time against decoding its video alone,
and its levels (`birch@6`) as one video against single lossless pictures. They were encoded once before, by
quantiser 20; a bake alone has levels before any encoding.
"""

import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from face_baking.development import psnr_db
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from bench.harness import say
from experiments.load import load_experiment
from stimuli_builder.characters import atlas
from stimuli_builder.characters.atlas import SHIPPED, decode_picture, load_atlas
from stimuli_builder.characters.declaration import write_picture
from stimuli_builder.clips.characters import find_character, shipped_names
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.design_clips import Options, planned_clips
from stimuli_builder.clips.encode import encode_clip
from stimuli_builder.clips.frames import FramePainter
from stimuli_builder.clips.jobs import available_cores, render, run_jobs
from stimuli_builder.clips.levels import LevelSet

SAMPLE = 24
ALL = {"exp1": 320, "exp2": 200, "exp3": 80}
SIZE = (960, 360)


def some_jobs() -> list:
    """Every so manyth clip of the three experiments whose characters are here."""
    planned = []
    for name, count in ALL.items():
        experiment = load_experiment(name)
        needed = {lv.render.character for f in experiment.factors for lv in f.levels} - {None}
        if (needed or {experiment.render.character}) <= set(shipped_names()):
            planned += planned_clips(experiment, Options())[:: max(1, count * 3 // SAMPLE)]
    return [clip.job for clip in planned]


@pytest.fixture(scope="module", params=["cartoon", "alder@8"])
def character(request: pytest.FixtureRequest) -> LevelSet:
    if request.param not in shipped_names():
        pytest.skip(f"{request.param} is not baked here")
    return find_character(request.param).levels(SIZE)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((a - b) ** 2) + 1e-20))


def test_one_clip(benchmark: BenchmarkFixture, character: LevelSet) -> None:
    closure = np.concatenate([np.zeros(160), np.sin(np.linspace(0, np.pi, 100)), np.zeros(150)])
    painter = FramePainter(character)
    curve = ClipCurve(closure, 160, "bench")
    benchmark.pedantic(
        lambda: encode_clip(painter.frames(curve, 30, True), SIZE, 30), rounds=3, warmup_rounds=1
    )
    say(f"\n{character.name}: levels {character.levels.nbytes / 1e6:.0f} MB")


def test_codec_loss(character: LevelSet, benchmark: BenchmarkFixture) -> None:
    import io

    import av

    closure = np.concatenate([np.zeros(40), np.linspace(0, 1, 40), np.linspace(1, 0, 60), np.zeros(40)])
    frames = list(FramePainter(character).frames(ClipCurve(closure, 40, "bench"), 30, True))
    content = benchmark.pedantic(lambda: encode_clip(frames, SIZE, 30), rounds=1)
    with av.open(io.BytesIO(content)) as container:
        decoded = [frame.to_ndarray(format="yuv420p") for frame in container.decode(video=0)]
    each = [psnr(a / 255, b / 255) for a, b in zip(frames, decoded, strict=True)]
    rows, columns = character.window.slices
    outside = np.ones((SIZE[1], SIZE[0]), bool)
    outside[rows, columns] = False
    luma = np.stack([frame[: SIZE[1]] for frame in frames])[:, outside]
    seen = np.stack([frame[: SIZE[1]] for frame in decoded])[:, outside].astype(int)
    say(
        f"\n{character.name}: codec PSNR mean {np.mean(each):.1f}, worst {min(each):.1f} dB, "
        f"{len(content) / 1024:.0f} KiB for {len(frames)} frames; outside the crop: given frames differ by "
        f"{int(np.ptp(luma, axis=0).max())}, decoded by {int(np.ptp(seen, axis=0).max())} code values"
    )


def test_cartoon_midpoints(benchmark: BenchmarkFixture) -> None:
    from stimuli_builder.characters.cartoon import LEVELS, crop_px, draw_frame
    from stimuli_builder.characters.colour import encode_srgb
    from stimuli_builder.clips.character_levels import _light_of_code

    window, step = crop_px(SIZE), 1 / (LEVELS - 1)

    def worst() -> float:
        differences = []
        for low in np.arange(0, LEVELS - 1, 8) * step:
            a, true, b = (draw_frame(float(w), SIZE, window) for w in (low, low + step / 2, low + step))
            mean = (_light_of_code(a) / 65535 + _light_of_code(b) / 65535) / 2
            differences.append(psnr(encode_srgb(mean.astype(np.float32)), true))
        return min(differences)

    differences = benchmark.pedantic(worst, rounds=1)
    say(f"\ncartoon, {LEVELS} levels: worst midpoint {differences:.1f} dB (must 44, aim 47.5)")


def test_set_of_clips(benchmark: BenchmarkFixture) -> None:
    jobs = some_jobs()
    if not jobs:
        pytest.skip("no experiment's characters are all here")
    cores = available_cores()
    begun = time.perf_counter(), os.times()
    benchmark.pedantic(lambda: list(run_jobs(jobs, cores)), rounds=1)
    wall, after = time.perf_counter() - begun[0], os.times()
    cpu = after.children_user + after.children_system - begun[1].children_user - begun[1].children_system
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    say(
        f"\n{len(jobs)} clips on {cores} cores: {wall:.1f} s wall, {cpu:.1f} s CPU (start included); "
        f"600 clips: {wall / len(jobs) * 600 / 60:.1f} min wall, "
        f"{cpu / len(jobs) * 600 / 2 / 60:.1f} min at full use of 2 cores (must 5, aim 2); "
        f"greatest process {peak:.2f} GB (must 1.5)"
    )


def test_speed_up(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    jobs = some_jobs()[:12]
    if not jobs:
        pytest.skip("no experiment's characters are all here")
    begun = time.perf_counter()
    alone = [render(job) for job in jobs]
    one = time.perf_counter() - begun
    begun = time.perf_counter()
    many = dict(benchmark.pedantic(lambda: list(run_jobs(jobs, 2)), rounds=1))
    say(f"\n{len(jobs)} clips: 1 process {one:.1f} s, 2 processes {time.perf_counter() - begun:.1f} s")
    assert [many[index] for index in range(len(jobs))] == alone


# In a separate process: the peak memory of a process never decreases.
READING = """
import resource, sys, time
import cv2
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.atlas import decode_level_video
from stimuli_builder.clips.characters import find_character
import stimuli_builder.clips.characters

cv2.setNumThreads(1)
name, most = sys.argv[1], lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
before, began = most(), time.process_time()
levels = find_character(name).levels((960, 360))
took, peak = time.process_time() - began, most() - before
kept = levels.base.nbytes + levels.levels.nbytes
with_lower = peak
if levels.read_lower:
    levels.lower
    with_lower = most() - before
content, began = (SHIPPED / name / "levels.mkv").read_bytes(), time.process_time()
decode_level_video(content, "levels", "levels.mkv")
print(took, time.process_time() - began, peak, kept, with_lower)
"""


@pytest.mark.parametrize("name", sorted(file.parent.name for file in SHIPPED.glob("*/levels.mkv")))
def test_reading(name: str) -> None:
    command = [sys.executable, "-c", READING, name]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    took, decoding, peak, kept, with_lower = map(float, out.split())
    sys.stdout.write(
        f"\n{name}: {peak / 1e6:.0f} MB at the most above the libraries, {peak / kept:.2f} of the "
        f"{kept / 1e6:.0f} MB of levels that stay, {with_lower / 1e6:.0f} MB once the lower lid moves; "
        f"{took:.2f} s of processor, {took / decoding:.1f} of its video's decoding\n"
    )


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
    monkeypatch.setattr(atlas, "QUANTISER", quantiser)
    atlas.write_level_video(tmp_path, "levels.mkv", levels)
    content = (tmp_path / "levels.mkv").read_bytes()
    began = time.process_time()
    frames = atlas.decode_level_video(content, "levels", "levels.mkv")
    took = time.process_time() - began
    worst = min(psnr_db(a, b) for a, b in zip(frames, levels, strict=True))
    error = max(int(np.abs(a.astype(int) - b).max()) for a, b in zip(frames, levels, strict=True))
    sys.stdout.write(
        f"\nquantiser {quantiser}: {len(content) / 1e6:.1f} MB against {megabytes:.1f} MB, "
        f"least PSNR {worst:.1f} dB, greatest error {error}; "
        f"reading takes {took / seconds:.2f} of single pictures' {seconds:.2f} s\n"
    )
