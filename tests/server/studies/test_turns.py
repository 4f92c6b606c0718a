"""Nobody's videos keep another account's waiting: neither many, nor long ones, nor those made for it."""

import hashlib
import os
import signal
import struct
import zlib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import pytest

from experiments.errors import counted
from server.transcoding import worker
from server.transcoding.preparing import examine_clips
from server.transcoding.records import RECORDS, mark, records_of, waiting_in
from server.transcoding.worker import address_limit, started_at_most
from tests.helpers.videos import write_video
from video_conversion.prepare import prepare
from video_conversion.video_file import NotAClip

SIDE = 4096


def still(path: Path, size_px: tuple[int, int], frames: int, fps: int = 30) -> Path:
    """A grey picture repeated: after the first frame each takes a few bytes."""
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("libx264", rate=fps)
        stream.width, stream.height = size_px
        stream.pix_fmt = "yuv420p"
        stream.options = {"preset": "ultrafast", "x264-params": "keyint=infinite:log-level=error"}
        picture = av.VideoFrame(*size_px, "yuv420p")
        for plane in picture.planes:
            plane.update(bytes([128]) * plane.buffer_size)
        for number in range(frames):
            picture.pts, picture.time_base = number, Fraction(1, fps)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("frames", [1, 1200])
def test_a_clip_of_one_or_a_thousand_frames_is_as_declared(tmp_path: Path, frames: int) -> None:
    clip = still(tmp_path / "clip.mp4", (64, 64), frames)
    sha256 = hashlib.sha256(clip.read_bytes()).hexdigest()
    size = {"width_px": 64, "height_px": 64}
    order: dict[str, str | float] = {
        "path": str(clip),
        "sha256": sha256,
        "fps": 30.0,
        "frames": frames,
        **size,
    }
    fine, other = examine_clips([order, order | {"frames": 4}])
    assert fine == []
    seen = f"{counted(frames, 'frame')} of 64 x 64 pixels"
    assert other == [("different", f"expected 4 frames of 64 x 64 pixels, got {seen}")]


def gif(path: Path, frames: int, delay_cs: int) -> Path:
    """Frames of one pixel on a large canvas: 23 bytes per frame."""
    head = b"GIF89a" + struct.pack("<HHBBB", SIDE, SIDE, 0x80, 0, 0) + bytes(6)
    frame = (
        b"\x21\xf9\x04\x04" + struct.pack("<H", delay_cs) + b"\0\0\x2c" + struct.pack("<HHHHB", 0, 0, 1, 1, 0)
    )
    path.write_bytes(head + (frame + b"\x02\x02\x44\x01\x00") * frames + b"\x3b")
    return path


def chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def apng(path: Path, frames: int) -> Path:
    """Frames of one pixel on a large canvas: about 70 bytes per frame."""
    parts = [
        b"\x89PNG\r\n\x1a\n",
        chunk(b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 8, 0, 0, 0, 0)),
        chunk(b"acTL", struct.pack(">II", frames, 0)),
        chunk(b"fcTL", struct.pack(">IIIIIHHBB", 0, SIDE, SIDE, 0, 0, 1, 30, 0, 0)),
        chunk(b"IDAT", zlib.compress(bytes((SIDE + 1) * SIDE), 9)),
    ]
    for number in range(1, frames):
        parts.append(chunk(b"fcTL", struct.pack(">IIIIIHHBB", 2 * number - 1, 1, 1, 0, 0, 1, 30, 0, 0)))
        parts.append(chunk(b"fdAT", struct.pack(">I", 2 * number) + zlib.compress(bytes(2))))
    path.write_bytes(b"".join([*parts, chunk(b"IEND", b"")]))
    return path


def repeated_mp4(path: Path, times: int) -> Path:
    """An MP4 file whose index says that one frame is there many times: four bytes per frame."""
    content = bytearray(still(path, (SIDE, SIDE), 2).read_bytes())
    moov = content.index(b"moov") - 4
    stbl, offset = content.index(b"stbl") - 4, content.index(b"stsz") - 4
    sizes = content[offset : offset + struct.unpack_from(">I", content, offset)[0]]
    second = struct.unpack_from(">I", sizes, 24)[0]
    table = struct.pack(">II", 0, 2 + times) + sizes[20:28] + struct.pack(">I", second) * times
    longer = struct.pack(">I", 12 + len(table)) + b"stsz" + bytes(4) + table
    grown = len(longer) - len(sizes)
    content[offset : offset + len(sizes)] = longer
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        place = content.index(box) - 4
        struct.pack_into(">I", content, place, struct.unpack_from(">I", content, place)[0] + grown)
    stts = content.index(b"stts")
    struct.pack_into(">III", content, stts + 8, 1, 2 + times, 100)
    stsc = content.index(b"stsc")
    struct.pack_into(">III", content, stsc + 8, 1, 1, 2 + times)
    assert moov < stbl
    path.write_bytes(content)
    return path


def seldom(path: Path) -> Path:
    """Five large pictures, one of which is shown for two minutes."""
    head = b"GIF89a" + struct.pack("<HHBBB", SIDE, SIDE, 0x80, 0, 0) + bytes(6)
    parts = [head]
    for delay_cs in (2, 2, 2, 11_000, 2):
        parts.append(b"\x21\xf9\x04\x04" + struct.pack("<H", delay_cs) + b"\0\0\x2c")
        parts.append(struct.pack("<HHHHB", 0, 0, 1, 1, 0) + b"\x02\x02\x44\x01\x00")
    path.write_bytes(b"".join([*parts, b"\x3b"]))
    return path


HOSTILE: dict[str, tuple[str, Callable[[Path], Path], str]] = {
    "gif": ("a.gif", lambda path: gif(path, 2_500, 2), "billion pixels"),
    "apng": ("a.apng", lambda path: apng(path, 2_000), "billion pixels"),
    "mp4": ("a.mp4", lambda path: repeated_mp4(path, 5_000), "billion pixels"),
    "many frames": ("a.mp4", lambda path: still(path, (16, 16), 30_001, 600), "30000 frames"),
    "a high rate": ("a.mp4", lambda path: still(path, (16, 16), 3_000, 5_000), "frames per second"),
    "few frames shown for long": ("a.gif", seldom, "billion pixels"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_small_file_that_declares_more_than_a_clip_is_refused_before_it_is_decoded(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, write, words = HOSTILE[kind]
    path = write(tmp_path / name)
    assert path.stat().st_size < 400_000
    if kind != "few frames shown for long":  # whose few frames are decoded
        monkeypatch.setattr("video_conversion.video_file._decoded", None)
    with pytest.raises(NotAClip, match=words):
        prepare(path, tmp_path / "clips", None)


def test_pixels_that_are_stretched_beyond_the_largest_picture_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.y4m"
    frame = b"FRAME\n" + bytes(64 * 48 * 3 // 2)
    path.write_bytes(b"YUV4MPEG2 W64 H48 F30:1 Ip A200:1 C420\n" + 5 * frame)
    with pytest.raises(NotAClip, match="stretched to 12800 x 48"):
        prepare(path, tmp_path / "clips", None)


def upload_of(root: Path, name: str, account: int) -> Path:
    folder = root / name
    folder.mkdir(parents=True)
    mark(folder, account)
    return folder


def order_of_completion(folders: list[Path]) -> list[str]:
    """Names of the folders, the one whose last file was ready first in front."""
    return [folder.name for folder in sorted(folders, key=lambda one: (one / RECORDS).stat().st_mtime_ns)]


def test_accounts_take_turns_whatever_number_of_folders_and_files_one_has(tmp_path: Path) -> None:
    root = tmp_path / "uploads"
    many = [upload_of(root, f"a{number}", 1) for number in range(4)]
    for folder in many:
        for number in range(3):
            write_video(folder / f"{number}.webm", "libvpx-vp9")
    one = upload_of(root, "z", 2)
    write_video(one / "clip.webm", "libvpx-vp9")
    worker.work(root)
    assert not [path for folder in (*many, one) for path in waiting_in(folder)]
    assert order_of_completion([*many, one])[0] == "z"


def test_a_clip_is_ready_while_another_account_s_long_and_hostile_files_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "TURN_S", 0.1)
    root = tmp_path / "uploads"
    attacked = [upload_of(root, f"a{number}", 1) for number in range(3)]
    for folder in attacked:
        gif(folder / "bomb.gif", 2_500, 2)
        still(folder / "long.mp4", (1280, 720), 200, 480)
        (folder / ".frame_rate").write_text("120.0")
    one = upload_of(root, "z", 2)
    write_video(one / "clip.webm", "libvpx-vp9")
    worker.work(root)
    assert order_of_completion([*attacked, one])[0] == "z"
    assert records_of(one)["clip.webm"].problem is None
    for folder in attacked:
        records = records_of(folder)
        assert "billion pixels" in (records["bomb.gif"].problem or "")
        assert (records["long.mp4"].problem, records["long.mp4"].frames) == (None, 50)


def test_with_room_for_one_file_a_long_one_begins_again_behind_the_other_account_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "TURN_S", 0.05)
    monkeypatch.setattr(worker, "FIRST_BUDGET_S", 0.05)
    monkeypatch.setattr(worker, "started_at_most", lambda _: 1)
    root = tmp_path / "uploads"
    long, one = upload_of(root, "a", 1), upload_of(root, "z", 2)
    still(long / "long.mp4", (1280, 720), 200, 480)
    (long / ".frame_rate").write_text("120.0")
    write_video(one / "clip.webm", "libvpx-vp9")
    worker.work(root)
    assert order_of_completion([long, one]) == ["z", "a"]
    assert records_of(long)["long.mp4"].problem is None
    assert not [path.name for path in (long / ".clips").iterdir() if path.name.startswith(".")]


def upload_of_videos(root: Path, names: str) -> Path:
    folder = upload_of(root, "a", 1)
    for name in names:
        write_video(folder / f"{name}.webm", "libvpx-vp9")
    return folder


def usable(folder: Path) -> str:
    """Names of the files of which clips can be made."""
    return "".join(sorted(name[0] for name, record in records_of(folder).items() if record.problem is None))


def note_processes(root: Path, monkeypatch: pytest.MonkeyPatch, instead: Callable[[str, str], None]) -> None:
    """Let each file's process write its name down, after what is done `instead` with the names before it."""

    def noted(path: Path, clips: Path, asked_fps: float | None) -> Any:
        log = root / f"process_{os.getpid()}"
        before = log.read_text() if log.exists() else ""
        log.write_text(before + path.stem)
        instead(path.stem, before)
        return prepare(path, clips, asked_fps)

    monkeypatch.setattr(worker, "TURN_S", 60.0)  # one turn, however busy the machine is
    monkeypatch.setattr(worker, "prepare", noted)


def processes(root: Path) -> list[str]:
    """The names of the files that each process was at, in the order in which processes began."""
    return [log.read_text() for log in sorted(root.glob("process_*"), key=lambda log: log.stat().st_ctime_ns)]


def test_short_files_are_done_by_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abcd")
    note_processes(root, monkeypatch, lambda _name, _before: None)
    worker.work(root)
    assert (usable(folder), processes(root)) == ("abcd", ["abcd"])


def test_a_process_ends_with_its_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abc")
    note_processes(root, monkeypatch, lambda _name, _before: None)
    monkeypatch.setattr(worker, "TURN_S", 0.01)
    worker.work(root)
    assert (usable(folder), sorted(processes(root))) == ("abc", ["a", "b", "c"])


@pytest.mark.parametrize("killer", ["a", "b", "d"])
def test_a_file_that_ends_its_process_is_refused_and_costs_only_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, killer: str
) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abcd")

    def ends(name: str, _before: str) -> None:
        if name == killer:
            os.kill(os.getpid(), signal.SIGKILL)

    note_processes(root, monkeypatch, ends)
    worker.work(root)
    assert usable(folder) == "abcd".replace(killer, "")
    assert "decoder" in (records_of(folder)[f"{killer}.webm"].problem or "")
    before, after = "abcd".split(killer)
    assert processes(root) == [before + killer, *([after] if after else []), killer]
    assert not (folder / worker.BEGUN).exists()


def test_two_files_that_end_their_processes_cost_only_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abcdef")

    def ends(name: str, _before: str) -> None:
        if name in "be":
            os.kill(os.getpid(), signal.SIGKILL)

    note_processes(root, monkeypatch, ends)
    worker.work(root)
    assert usable(folder) == "acdf"


@pytest.mark.parametrize("problem", [MemoryError(), NotAClip("damaged")])
def test_no_file_is_refused_for_what_files_before_it_did_to_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, problem: Exception
) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abcd")

    def fails_after_a(_name: str, before: str) -> None:
        if before.startswith("a"):
            raise problem

    note_processes(root, monkeypatch, fails_after_a)
    worker.work(root)
    assert (usable(folder), processes(root)) == ("abcd", ["ab", "bcd"])


def test_a_file_that_is_unusable_is_refused_once_it_is_the_first_of_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abd")
    (folder / "c.webm").write_bytes(bytes(100))
    note_processes(root, monkeypatch, lambda _name, _before: None)
    worker.work(root)
    assert (usable(folder), processes(root)) == ("abd", ["abc", "cd"])
    assert "cannot be read" in (records_of(folder)["c.webm"].problem or "")


def test_each_file_of_a_process_has_the_time_limit_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "uploads"
    folder = upload_of_videos(root, "abcd")

    def hangs(name: str, _before: str) -> None:
        if name == "b":
            signal.pause()

    note_processes(root, monkeypatch, hangs)
    monkeypatch.setattr(worker, "TURN_S", 1.0)
    monkeypatch.setattr(worker, "LOOK_AGAIN_S", 0.1)
    monkeypatch.setattr(worker, "MAX_S_A_FILE", 3.0)
    worker.work(root)
    assert usable(folder) == "acd"


@pytest.mark.parametrize("machine_gib", [0.5, 1, 2, 4, 8, 16, 64, 1024])
def test_memory_of_all_files_together_stays_below_the_machine_s(machine_gib: float) -> None:
    machine = int(machine_gib * (1 << 30))
    limit = address_limit(machine)
    most = started_at_most(limit)
    assert most >= 1
    assert most * (limit // most) <= machine // 2


def test_a_container_s_limit_counts_where_it_is_lower_than_the_machine_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = worker.memory_of_machine()
    limit = tmp_path / "memory.max"
    monkeypatch.setattr(worker, "CGROUP_LIMITS", (str(limit),))
    limit.write_text("max\n")
    assert whole is not None
    assert (worker.memory_of_machine() or 0) >= whole
    limit.write_text(f"{256 << 20}\n")
    assert worker.memory_of_machine() == 256 << 20
