"""Clips: CPU and wall time per clip, all 600 by extrapolation, worst midpoint, opening, memory.

`make bench`, or: python -m pytest tests/bench/bench_clips.py -o python_files='bench_*.py' -s
"""

import os
import resource
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from experiments.load import load_experiment
from stimuli_builder.clips.characters import find_character, shipped_names
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.design_clips import Options, planned_clips
from stimuli_builder.clips.encode import encode_clip
from stimuli_builder.clips.frames import FramePainter
from stimuli_builder.clips.jobs import render
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.workers import available_cores, run_jobs

SAMPLE = 24
ALL = {"exp1": 320, "exp2": 200, "exp3": 80}
SIZE = (960, 360)


def say(text: str) -> None:
    sys.stdout.write(text + "\n")


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
        found = []
        for low in np.arange(0, LEVELS - 1, 8) * step:
            a, true, b = (draw_frame(float(w), SIZE, window) for w in (low, low + step / 2, low + step))
            mean = (_light_of_code(a) / 65535 + _light_of_code(b) / 65535) / 2
            found.append(psnr(encode_srgb(mean.astype(np.float32)), true))
        return min(found)

    found = benchmark.pedantic(worst, rounds=1)
    say(f"\ncartoon, {LEVELS} levels: worst midpoint {found:.1f} dB (must 44, aim 47.5)")


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
