"""Building a set: what is rendered, kept, thrown away, and what happens when it goes wrong."""

import os
import shutil
import signal
import subprocess
import sys
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from experiments.errors import InputError
from experiments.load import FOLDER, load_experiment
from experiments.manifest import MANIFEST_NAME, check_files, file_sha256, read_manifest
from stimuli_builder.clips import build as build_module
from stimuli_builder.clips.build import Machines, build
from stimuli_builder.clips.design_clips import Options, planned_clips
from stimuli_builder.clips.folder import STATE_NAME

from .conftest import Small, make_small


@pytest.fixture
def copied(built: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built, tmp_path / "clips"))


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_the_manifest_holds_the_design(small: Small, built: Path) -> None:
    manifest = read_manifest(built)
    check_files(manifest, built)
    assert [(clip.cell, clip.exemplar) for clip in manifest.clips] == [
        (cell, number)
        for cell in ("cartoon/real", "cartoon/mine", "own/real", "own/mine")
        for number in (1, 2)
    ]
    clip = manifest.clips[2]
    assert clip.levels == {"character": "cartoon", "profile": "mine"}
    assert (clip.profile, clip.duration_frames, clip.profile_repeated) == ("file-mine", 8.0, False)
    assert manifest.clips[3].profile_repeated
    assert len(clip.closure) == clip.frames * 10
    assert np.flatnonzero(clip.closure)[0] // 10 == clip.onset_frame
    assert clip.width_mm == pytest.approx(128)
    assert set(contents(built)) == {MANIFEST_NAME} | {clip.file for clip in manifest.clips}


def test_a_list_of_characters_builds_the_clips_of_its_levels(small_text: str, tmp_path: Path) -> None:
    head, _, rest = small_text.partition("[[factors.levels]]")
    listed = f'{head}character = ["cartoon", "tiny"]\n[[factors]]{rest.partition("[[factors]]")[2]}'
    written = small_text.replace('name = "own"', 'name = "tiny"')
    studies = [make_small(tmp_path, text) for text in (listed, written)]
    planned = [planned_clips(study.experiment, study.options) for study in studies]
    assert {clip.settings.character for clip in planned[0]} == {"cartoon", "tiny"}
    inputs = [[(clip.spec.cell, clip.job.input_hash) for clip in clips] for clips in planned]
    assert inputs[0] == inputs[1]


def test_both_characters_show_the_same_blinks(built: Path) -> None:
    clips = read_manifest(built).clips
    assert [clip.profile for clip in clips[:4]] == [clip.profile for clip in clips[4:]]


def test_the_same_seed_gives_the_same_folder(small: Small, built: Path, tmp_path: Path) -> None:
    small.build(tmp_path / "again")
    assert contents(tmp_path / "again") == contents(built)


def test_another_seed_gives_other_curves(small: Small, built: Path) -> None:
    planned = planned_clips(small.experiment, Options(seed=1, base_folder=small.folder))
    assert [clip.job.curve.closure.tolist() for clip in planned] != [
        list(clip.closure) for clip in read_manifest(built).clips
    ]


def test_a_finished_build_renders_nothing(small: Small, copied: Path) -> None:
    stamp = (copied / MANIFEST_NAME).stat().st_mtime_ns
    report = small.build(copied)
    assert (report.built, report.reused) == (0, 8)
    assert (copied / MANIFEST_NAME).stat().st_mtime_ns == stamp


def test_only_missing_and_damaged_clips_are_rendered(small: Small, built: Path, copied: Path) -> None:
    first, second = (copied / clip.file for clip in read_manifest(built).clips[:2])
    first.unlink()
    second.write_bytes(b"\0" * second.stat().st_size)
    assert small.build(copied).built == 2
    assert contents(copied) == contents(built)


def test_a_changed_curve_replaces_its_clips_alone(small_text: str, copied: Path, tmp_path: Path) -> None:
    changed = make_small(tmp_path / "study", small_text.replace("duration_frames = 8", "duration_frames = 9"))
    report = changed.build(copied)
    assert (report.built, report.reused, len(report.removed)) == (4, 4, 4)
    assert set(contents(copied)) == {MANIFEST_NAME} | {clip.file for clip in report.manifest.clips}


def test_a_changed_character_renders_its_clips_again(small_text: str, copied: Path, tmp_path: Path) -> None:
    changed = make_small(tmp_path / "study", small_text)
    declaration = changed.folder / "tiny" / "character.toml"
    declaration.write_text(declaration.read_text().replace("Tiny test", "Other tiny test"))
    assert changed.build(copied).built == 4


def test_an_interrupted_build_goes_on_where_it_stopped(small: Small, built: Path, tmp_path: Path) -> None:
    out = tmp_path / "clips"

    def stop_at_three(done: int, wanted: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(InputError, match="interrupted; 3 clips are finished"):
        build(small.experiment, out, small.options, Machines(workers=1), stop_at_three)
    assert not (out / MANIFEST_NAME).exists()
    assert len(list(out.glob("*.mp4"))) == 3
    with (out / STATE_NAME).open("a") as stream:
        stream.write('{"input_hash": "torn')
    assert small.build(out).built == 5
    assert contents(out) == contents(built)


def test_a_folder_of_another_experiment_is_left_alone(small_text: str, copied: Path, tmp_path: Path) -> None:
    other = make_small(tmp_path / "study", small_text.replace('name = "small"', 'name = "other"'))
    with pytest.raises(InputError, match="has the clips of 'small'"):
        other.build(copied)


def test_processes_and_a_killed_worker_change_nothing(small: Small, built: Path, tmp_path: Path) -> None:
    killed = []

    def kill_one(done: int, wanted: int) -> None:
        if done == 1 and not killed:
            victim = active_children()[0]
            os.kill(victim.pid or 0, signal.SIGKILL)
            killed.append(victim.pid)

    report = build(small.experiment, tmp_path / "clips", small.options, Machines(workers=2), kill_one)
    assert killed
    assert report.built == 8
    assert contents(tmp_path / "clips") == contents(built)


def test_a_dask_cluster_gives_the_same_clips(small: Small, built: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra 'dask' is not installed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        small.build(tmp_path / "clips", Machines(dask=cluster.scheduler_address))
    assert contents(tmp_path / "clips") == contents(built)


def test_no_dask_scheduler_ends_in_one_line(small: Small, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra 'dask' is not installed")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        small.build(tmp_path / "clips", Machines(dask="nowhere:0:0"))


FULL_DISK = """
import resource, signal, sys
sys.dont_write_bytecode = True  # else CPython keeps modules compiled up to the limit
from stimuli_builder.cli import main
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, 8_000))
sys.argv[0] = "stimuli"
main()
"""


def on_a_full_disk(*arguments: object) -> str:
    """Run a command where a limit on file size acts as the end of the disk; returns its one line."""
    command = [sys.executable, "-c", FULL_DISK, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    return line


def test_a_full_disk_ends_in_one_line_and_leaves_no_half_clip(small: Small, tmp_path: Path) -> None:
    out = tmp_path / "clips"
    assert on_a_full_disk("build", small.toml, "--out", out, "--workers", 1).startswith("error: ")
    assert not (out / MANIFEST_NAME).exists()
    assert not list(out.glob(".*part*"))
    assert all(file_sha256(clip) == clip.stem for clip in out.glob("*.mp4"))


def test_a_full_disk_leaves_no_single_clip_and_no_preview(copied: Path, small: Small, tmp_path: Path) -> None:
    file = tmp_path / "one.mp4"
    line = on_a_full_disk("clip", "--profile", "AL", "--out", file, "--size", "480x180")
    assert "cannot be written" in line
    line = on_a_full_disk("build", small.toml, "--out", copied, "--preview")
    assert line.startswith(f"error: {copied / 'preview.png'} cannot be written")
    assert {path.suffix for path in (*tmp_path.iterdir(), *copied.iterdir())} == {"", ".json", ".mp4"}
    assert not file.exists()


KILLED = """
import os, signal, sys
from multiprocessing import active_children
from pathlib import Path
from experiments.load import load_experiment
from stimuli_builder.clips.build import Machines, build
from stimuli_builder.clips.design_clips import Options

def stop(done, wanted):
    if done == 1:
        print(*(child.pid for child in active_children()), flush=True)
        os.kill(os.getpid(), signal.SIGKILL)

toml, out = sys.argv[1:]
if __name__ == "__main__":
    build(load_experiment(toml), Path(out), Options(base_folder=Path(toml).parent), Machines(2), stop)
"""


def test_workers_end_with_a_build_that_was_killed(small: Small, built: Path, tmp_path: Path) -> None:
    out, script = tmp_path / "clips", tmp_path / "killed.py"
    script.write_text(KILLED)
    command = [sys.executable, str(script), str(small.toml), str(out)]
    # Workers write to their own end of stdout, which stays open until the last one is gone.
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        workers = [int(pid) for pid in (process.communicate(timeout=60)[0]).split()]
    assert process.returncode == -signal.SIGKILL
    assert len(workers) == 2
    assert not (out / MANIFEST_NAME).exists()
    assert small.build(out).built == 7
    assert contents(out) == contents(built)


def test_a_folder_that_cannot_be_written_is_named(
    small: Small, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(build_module, "write_bytes", full)
    with pytest.raises(InputError, match="No space left on device"):
        small.build(tmp_path / "clips")


def test_a_file_in_place_of_the_folder_is_refused(small: Small, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a folder"):
        small.build(tmp_path / "file")


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            'character = "tiny"',
            'character = "tinny"',
            "cell own/real, exemplar 1: there is no character 'tinny'",
        ),
        ('character = "cartoon"', 'character = "cartoon", lower_lid = "both"', "no lower-lid layer"),
        ("height_px = 120", "height_px = 200", "120 px high"),
        ("width_px = 320", "width_px = 480", "cell cartoon/real, .* cuts off moving parts of a blink"),
        ('profile = "mine.csv"', 'profile = "yours.csv"', "yours.csv"),
    ],
)
def test_what_cannot_be_rendered_is_refused_before_anything_is(
    small_text: str, tmp_path: Path, old: str, new: str, line: str
) -> None:
    wrong = make_small(tmp_path / "study", small_text.replace(old, new))
    with pytest.raises(InputError, match=line):
        wrong.build(tmp_path / "clips")
    assert not (tmp_path / "clips").exists()


@pytest.mark.parametrize("damage", ["missing", "bytes"])
def test_a_missing_or_damaged_level_is_named(small_text: str, tmp_path: Path, damage: str) -> None:
    wrong = make_small(tmp_path / "study", small_text)
    level = wrong.folder / "tiny" / "level_0.50.webp"
    if damage == "missing":
        level.unlink()
    else:
        level.write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"level_0\.50\.webp"):
        wrong.build(tmp_path / "clips")
    assert not (tmp_path / "clips" / MANIFEST_NAME).exists()


def test_a_design_that_cannot_be_analysed_is_refused_before_a_clip_is_rendered(tmp_path: Path) -> None:
    declared = load_experiment(str(FOLDER / "pairs-demo.toml"))
    alone = declared.model_copy(update={"participants": 1})
    few = alone.model_copy(update={"trial": declared.trial.model_copy(update={"pairs_per_person": 1})})
    with pytest.raises(InputError, match="groups never compared with one another"):
        build(few, tmp_path / "clips")
    assert not (tmp_path / "clips").exists()
