"""The MP4 files."""

import io
import os
import subprocess
import sys
from itertools import pairwise

import av
import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.encode import encode_clip
from stimuli_builder.clips.frames import FramePainter


@pytest.fixture(scope="module")
def frames() -> list[np.ndarray]:
    closure = np.concatenate([np.zeros(50), np.linspace(0, 1, 40), np.linspace(1, 0, 60), np.zeros(50)])
    return list(
        FramePainter(find_character("cartoon").levels((320, 120))).frames(
            ClipCurve(closure, 50, "t"), 30, True
        )
    )


@pytest.fixture(scope="module")
def content(frames: list[np.ndarray]) -> bytes:
    return encode_clip(frames, (320, 120), 30)


def test_the_same_frames_give_the_same_bytes(frames: list[np.ndarray], content: bytes) -> None:
    assert encode_clip(frames, (320, 120), 30) == content


def test_a_picture_that_rests_gives_the_bytes_of_its_copies(frames: list[np.ndarray], content: bytes) -> None:
    assert frames[0] is frames[1]
    assert encode_clip([frame.copy() for frame in frames], (320, 120), 30) == content


def test_pixels_survive_with_a_bare_loss(frames: list[np.ndarray], content: bytes) -> None:
    with av.open(io.BytesIO(content)) as container:
        decoded = [frame.to_ndarray(format="yuv420p") for frame in container.decode(video=0)]
    assert len(decoded) == len(frames)
    errors = np.stack(decoded).astype(float) - np.stack(frames)
    assert 10 * np.log10(255**2 / np.mean(errors**2)) > 44


def test_one_group_of_pictures_without_b_frames_at_a_constant_rate(content: bytes) -> None:
    with av.open(io.BytesIO(content)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.size]
        assert stream.average_rate == 30
        assert not stream.codec_context.has_b_frames
    assert [packet.is_keyframe for packet in packets] == [True] + [False] * (len(packets) - 1)
    assert [packet.pts for packet in packets] == [packet.dts for packet in packets]
    assert len({b.pts - a.pts for a, b in pairwise(packets)}) == 1


def test_the_colours_are_tagged_and_the_index_comes_first(content: bytes) -> None:
    with av.open(io.BytesIO(content)) as container:
        context = container.streams.video[0].codec_context
        tags = (context.color_range, context.colorspace, context.color_primaries, context.color_trc)
    assert tags == (1, 1, 1, 1)
    assert 0 < content.index(b"moov") < content.index(b"mdat")


@pytest.mark.parametrize("fps", [24, 25, 50, 60])
def test_other_rates_are_exact(frames: list[np.ndarray], fps: int) -> None:
    with av.open(io.BytesIO(encode_clip(frames[:6], (320, 120), fps))) as container:
        times = [float(frame.pts * frame.time_base) for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(6) / fps, atol=1e-6)


def test_a_temporary_folder_that_cannot_be_written_is_named(
    frames: list[np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", "/proc")
    with pytest.raises(InputError, match="cannot be written"):
        encode_clip(frames[:2], (320, 120), 30)


ENCODED_ANEW = """
import hashlib
import numpy as np
from stimuli_builder.clips.encode import encode_clip
y, x = np.mgrid[:360, :960]
planes = []
for shift in range(12):
    frame = np.full((540, 960), 128, dtype=np.uint8)
    frame[:360] = 100 + 40 * np.sin(x / 23) + 30 * np.cos((y - 3 * shift * (x > 480)) / 9)
    planes.append(frame)
print(hashlib.sha256(encode_clip(planes, (960, 360), 30)).hexdigest())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="memory is filled by a switch of glibc")
def test_bytes_do_not_depend_on_what_memory_held_before() -> None:
    command = [sys.executable, "-c", ENCODED_ANEW]
    plain, filled = (
        subprocess.run(
            command, env={**os.environ, "MALLOC_PERTURB_": byte}, capture_output=True, text=True, check=True
        ).stdout
        for byte in ("0", "1")
    )
    assert plain == filled
