"""A cluster of real processes, one of which is killed: the clips are those of one process."""

import os
import signal
from pathlib import Path

import pytest

from stimuli_builder.clips.build import Machines, build

from .conftest import Small

distributed = pytest.importorskip("distributed", reason="the extra 'dask' is not installed")


def test_a_cluster_that_loses_a_worker_gives_the_same_clips(
    small: Small, built: Path, tmp_path: Path
) -> None:
    killed: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as cluster:

        def kill_one(done: int, wanted: int) -> None:
            if not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        machines = Machines(dask=cluster.scheduler_address)
        report = build(small.experiment, tmp_path / "clips", small.options, machines, kill_one)
    assert killed
    assert report.built == 8
    made = {file.name: file.read_bytes() for file in (tmp_path / "clips").iterdir()}
    assert made == {file.name: file.read_bytes() for file in built.iterdir()}
