"""A character as baked pictures, decoded: what blends them is `stimuli_builder.clips`.

The atlas holds one full open-eye frame and, for a rising list of closures, the crop that a blink changes.
"""

import hashlib
import lzma
import shutil
import subprocess
import tarfile
import tempfile
import tomllib
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import BaseModel, ConfigDict, Field

from experiments.errors import InputError, did_you_mean
from stimuli_builder.characters.colour import (
    FORMAT,
    frame_planes,
    level_weights,
    picture_of,
    planes_of,
    srgb_to_linear,
)
from stimuli_builder.characters.declaration import (
    DECLARATION_FILE,
    REPAIR,
    Declaration,
    Level,
    LowerLidPose,
    Picture,
    PictureOrFrame,
    read_declaration,
    write_bytes_declared,
)

# Levels of an atlas as frames of one video: alike as they are, they take a fraction of single pictures.
#
# H.264's decoding is exact by the standard, so every machine reads the same code values. Videos of earlier
# bakes hold planes of R, G and B and are read as they are.

QUANTISER = 21
"""x264's constant quantiser of ten-bit planes: with 22 `alder@7` has 48.1 dB or more."""
STILL_CODES = 2
"""Code values that the encoder may change of a pixel which stands still: skin must not flicker."""


def write_level_video(folder: Path, file: str, pictures: Sequence[NDArray[np.uint8]]) -> Picture:
    """Write (h, w, 3) sRGB pictures of one size as a video; return what the declaration says of it."""
    height, width = pictures[0].shape[:2]
    buffer = BytesIO()
    with av.open(buffer, "w", format="matroska") as container:
        # One thread and no date in the header: the same pictures give the same bytes.
        container.flags |= 0x400
        stream = container.add_stream(
            "libx264", rate=30, options={"qp": str(QUANTISER), "preset": "slow", "threads": "1"}
        )
        stream.width, stream.height, stream.pix_fmt = width, height, FORMAT
        for picture in pictures:
            container.mux(stream.encode(_frame(picture)))
        container.mux(stream.encode())
    return write_bytes_declared(folder, file, buffer.getvalue())


class StillPixels:
    """Which pixels of pictures seen one after another change by no more than the encoder's own noise."""

    def __init__(self, first: NDArray[np.uint8]) -> None:
        self._first, self._low, self._high = first.copy(), first.copy(), first.copy()

    def see(self, picture: NDArray[np.uint8]) -> None:
        """Take in one more picture of code values."""
        np.minimum(self._low, picture, out=self._low)
        np.maximum(self._high, picture, out=self._high)

    def hold(self, pictures: NDArray[Any]) -> None:
        """Give such pixels of (n, h, w, 3) pictures, in whatever encoding, their value in the first."""
        # Both differences are 0 or more, so that uint8 does not wrap round.
        off = np.maximum(self._high - self._first, self._first - self._low)
        still = ~(off > STILL_CODES).any(axis=-1, keepdims=True)
        for picture in pictures[1:]:
            np.copyto(picture, pictures[0], where=still)


def decode_level_video(content: bytes, what: str, file: str) -> NDArray[np.uint8]:
    """(n, h, w, 3) sRGB code values of every frame; InputError where it is none or damaged."""
    shown, frames = 0, np.empty((0, 0, 0, 3), np.uint8)
    for shown, frame in enumerate(video_frames(content, what, file), start=1):
        if shown == 1:
            # Into one array: a list of frames and their stack would be there twice.
            frames, still = np.empty((_count(content), *frame.shape), np.uint8), StillPixels(frame)
        frames[shown - 1] = frame
        still.see(frame)
    still.hold(frames[:shown])
    return frames[:shown]


def video_frames(content: bytes, what: str, file: str) -> Iterator[NDArray[np.uint8]]:
    """(h, w, 3) sRGB code values of frame after frame, still pixels with the encoder's noise.

    Raises
    ------
    InputError
        The content is no such video, is damaged, or holds no frame.
    """
    shown = 0
    try:
        with av.open(BytesIO(content)) as container:
            container.streams.video[0].thread_type = "AUTO"
            for frame in container.decode(video=0):
                yield _rgb(frame)
                shown += 1
    except (av.error.FFmpegError, ValueError, IndexError) as error:
        raise InputError(f"{what} is damaged: cannot decode {file}; {REPAIR}") from error
    if not shown:
        raise InputError(f"{what} is damaged: {file} has no frame; {REPAIR}")


def _count(content: bytes) -> int:
    """Frames at the most: every packet may be one."""
    with av.open(BytesIO(content)) as container:
        return sum(packet.size > 0 for packet in container.demux(video=0))


def _frame(picture: NDArray[np.uint8]) -> av.VideoFrame:
    frame = av.VideoFrame(picture.shape[1], picture.shape[0], FORMAT)
    for plane, content in zip(frame.planes, planes_of(picture), strict=True):
        # FFmpeg pads rows to its alignment.
        rows = np.zeros((plane.height, plane.line_size // content.itemsize), content.dtype)
        rows[:, : content.shape[1]] = content
        plane.update(rows.tobytes())
    return frame


def _rgb(frame: Any) -> NDArray[np.uint8]:
    """Code values of a decoded frame, by our own conversion of colors alone."""
    if frame.format.name not in (FORMAT, "gbrp"):
        raise ValueError(f"planes are {frame.format.name}, expected {FORMAT} or gbrp")
    planes = frame_planes(frame)
    if frame.format.name == FORMAT:
        return picture_of(planes)
    # Planes of gbrp are green, blue and red.
    return np.stack([planes[2], planes[0], planes[1]], -1)


# The atlas: pictures of one character at every closure, and the shipped ones.

# Reading a character's pictures: as they were declared, or one clear line.


def decode_picture(folder: Path, picture: Picture, size: Sequence[int], what: str) -> NDArray[np.uint8]:
    """(h, w, 3) sRGB code values of one picture; InputError where missing, damaged or the wrong size."""
    content = declared_bytes(folder, picture, what)
    try:
        image = Image.open(BytesIO(content)).convert("RGB")
    except (OSError, UnidentifiedImageError, ValueError) as error:
        raise InputError(f"{what} is damaged: cannot decode {picture.file}; {REPAIR}") from error
    if image.size != tuple(size):
        declared = " x ".join(str(n) for n in size)
        raise InputError(
            f"{what}: {picture.file} is {image.width} x {image.height} px, but {declared} px are declared"
        )
    return np.asarray(image, dtype=np.uint8)


def declared_bytes(folder: Path, picture: Picture, what: str) -> bytes:
    """Content of one declared file; InputError where it is missing or another than declared."""
    try:
        content = (folder / picture.file).read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{what} is missing: no {picture.file} in {folder}; {REPAIR}") from error
    except OSError as error:
        raise InputError(f"{what} is damaged: cannot decode {picture.file}; {REPAIR}") from error
    if picture.sha256 is not None and hashlib.sha256(content).hexdigest() != picture.sha256:
        raise InputError(f"{what} is damaged: {picture.file} does not match its declared sha256; {REPAIR}")
    return content


def slices(crop: tuple[int, int, int, int]) -> tuple[slice, slice]:
    """Rows and columns of an (x, y, width, height) box."""
    x, y, width, height = crop
    return slice(y, y + height), slice(x, x + width)


# The lower lid of a baked character: poses of the open eye, laid under the upper lid of any closure.

LevelCodes = Callable[[int], NDArray[np.uint8]]
"""(h, w, 3) sRGB code values of a level's crop, by the level's number."""
SHADE_LIMITS = (0.2, 1.1)
SHADE_BLUR_MM = 0.4
DARKEST = np.float32(2e-3)


class LowerLidLayer:
    """Poses of the open eye's lower lid, laid under the upper lid of any closure.

    I(w, v, h) = I(w) + (1 - matte(w)) (pose(v, h) - pose(0, 0)) R(w), where w is the closure, v and h the
    lift and the slide in mm, and R the blurred brightness of I(w) over that of I(0), clipped: the shade that
    the upper lid throws on the moved skin. `stimuli_builder.clips.levels` adds it to frames. `level_srgb`
    spares decoding the levels again where they are in memory.
    """

    def __init__(self, character: "Atlas", level_srgb: LevelCodes | None = None) -> None:
        self._level_srgb = level_srgb or character.level_srgb
        lower = character.declaration.lower_lid
        if lower is None:
            raise InputError(f"character '{character.name}' has no lower-lid layer: use lower lid 'none'")
        self._character, self._lower = character, lower
        self.vertical_mm, self.horizontal_mm = np.array(lower.vertical_mm), np.array(lower.horizontal_mm)
        crop = character.declaration.crop
        rows, columns = slices(lower.crop)
        self.window = (
            slice(rows.start - crop[1], rows.stop - crop[1]),
            slice(columns.start - crop[0], columns.stop - crop[0]),
        )
        self.matte_closures = np.array([matte.closure for matte in lower.mattes])
        self.shape = (lower.crop[3], lower.crop[2], 3)

    def factor_at(self, index: int) -> NDArray[np.float32]:
        """(h, w, 1 or 3) of visible share times shade at the closure of one matte."""
        matte = self._lower.mattes[index]
        what = f"lower-lid matte at closure {matte.closure:g}"
        code = decode_picture(self._character.folder, matte, self._lower.crop[2:], what)[..., :1]
        visible = np.float32(1) - code.astype(np.float32) / np.float32(255)
        return (visible * self._shade(matte.closure)).astype(np.float32)

    def _shade(self, closure: float) -> NDArray[np.float32]:
        character = self._character
        weights = level_weights(character.closures, [closure])[0].astype(np.float32)
        image = np.zeros((self._lower.crop[3], self._lower.crop[2], 3), np.float32)
        for index in np.flatnonzero(weights):
            image += weights[index] * srgb_to_linear(self._level_srgb(int(index)))[self.window]
        open_eye, open_blurred = self._open_eye
        # Dark places would divide by nearly nothing.
        ratio = _blur(image, self._sigma) / np.maximum(open_blurred, 1e-3)
        # Never take more light from a pixel than it has: lashes over the lid would turn into red flecks.
        left = (image + DARKEST) / (open_eye + DARKEST)
        bounded = np.minimum(np.clip(ratio, *SHADE_LIMITS), left.min(axis=2, keepdims=True))
        return np.asarray(bounded, dtype=np.float32)

    @cached_property
    def _open_eye(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(h, w, 3) linear light of the open eye, and the same blurred: for the shade at every matte."""
        open_eye = srgb_to_linear(self._level_srgb(0))[self.window]
        return open_eye, _blur(open_eye, self._sigma)

    @property
    def _sigma(self) -> float:
        """Width of the shade's blur in px."""
        return SHADE_BLUR_MM * self._character.declaration.px_per_mm

    def each_change(self) -> Iterator[NDArray[np.float32]]:
        """(h, w, 3) change of each pose against the resting one; slides of the lowest lift first."""
        poses = {(pose.vertical_mm, pose.horizontal_mm): pose for pose in self._lower.poses}
        rest = self._pose(poses[(0.0, 0.0)])
        for v, h in product(self._lower.vertical_mm, self._lower.horizontal_mm):
            yield self._pose(poses[(v, h)]) - rest

    @property
    def changes(self) -> NDArray[np.float32]:
        """(vertical, horizontal, h, w, 3) changes, all at once."""
        whole = np.stack(list(self.each_change()))
        return whole.reshape(len(self.vertical_mm), len(self.horizontal_mm), *whole.shape[1:])

    def _pose(self, pose: LowerLidPose) -> NDArray[np.float32]:
        return srgb_to_linear(self._character.pose_srgb(pose, self._lower.crop[2:]))


def _blur(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), dtype=np.float32)


SHIPPED = Path(__file__).parent / "data"


class Atlas:
    """The pictures of one baked character, decoded as far as they have been asked for.

    Attributes
    ----------
    folder : Path
        Where the pictures lie.
    declaration : Declaration
        The validated content of `character.toml`.
    """

    def __init__(self, folder: Path, declaration: Declaration) -> None:
        self.folder = folder
        self.declaration = declaration
        self._videos: dict[str, NDArray[np.uint8]] = {}

    @property
    def name(self) -> str:
        """The character's name, as manifests have it."""
        return self.declaration.name

    @property
    def closures(self) -> NDArray[np.float64]:
        """(n,) closures of the baked levels, ascending from 0 to 1."""
        return np.array([level.closure for level in self.declaration.levels])

    @property
    def crop(self) -> tuple[slice, slice]:
        """Rows and columns of the full frame that a blink may change."""
        return slices(self.declaration.crop)

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the full frame."""
        return self.declaration.size_px

    @property
    def has_lower_lid(self) -> bool:
        """Whether the lower lid can be moved by its own signals."""
        return self.declaration.lower_lid is not None

    def base_linear(self) -> NDArray[np.float32]:
        """(height, width, 3) linear light of the whole open-eye frame."""
        return srgb_to_linear(self._picture_or_frame(self.declaration.base, self.size_px, "base frame"))

    def level_srgb(self, index: int) -> NDArray[np.uint8]:
        """(h, w, 3) sRGB code values of one level's crop."""
        level = self.declaration.levels[index]
        what = f"atlas level {index} (closure {level.closure:g})"
        return self._picture_or_frame(level, self.declaration.crop[2:], what)

    def pose_srgb(self, pose: LowerLidPose, size: tuple[int, int]) -> NDArray[np.uint8]:
        """(h, w, 3) sRGB code values of one pose of the lower lid, which is of `size` (width, height)."""
        what = f"lower-lid pose ({pose.vertical_mm:g}, {pose.horizontal_mm:g}) mm"
        return self._picture_or_frame(pose, size, what)

    def levels_linear(self) -> NDArray[np.float32]:
        """(n, h, w, 3) linear light of every level's crop; decoded at each call, so keep it.

        129 levels of 730 x 230 px take 260 MB.
        """
        width, height = self.declaration.crop[2:]
        levels = np.empty((len(self.declaration.levels), height, width, 3), np.float32)
        for index in range(len(levels)):
            levels[index] = srgb_to_linear(self.level_srgb(index))
        return levels

    def read_levels(self, out: NDArray[Any], convert: Callable[[NDArray[np.uint8]], NDArray[Any]]) -> None:
        """Write each level's crop into `out` (n, h, w, 3), its code values given through `convert`.

        A video whose frames are the levels is converted as it is decoded, without being kept.
        """
        video = self._video_of_levels()
        if video is None or not self._convert_frames(video, out, convert):
            for index in range(len(out)):
                out[index] = convert(self.level_srgb(index))

    def _video_of_levels(self) -> Level | None:
        """The first level where all are the frames of one video in their order."""
        first, *others = self.declaration.levels
        ordered = all(level.frame == number for number, level in enumerate(self.declaration.levels))
        return first if ordered and {level.file for level in others} == {first.file} else None

    def _convert_frames(
        self, video: Picture, out: NDArray[Any], convert: Callable[[NDArray[np.uint8]], NDArray[Any]]
    ) -> bool:
        """Whether the video holds what is declared; else `level_srgb` says what it lacks."""
        frames = video_frames(declared_bytes(self.folder, video, "atlas levels"), "atlas levels", video.file)
        first = next(frames)
        if first.shape[1::-1] != self.declaration.crop[2:]:
            return False
        still, count = StillPixels(first), 1
        out[0] = convert(first)
        for count, frame in enumerate(frames, start=2):
            # Seen even if it is not kept, as in `decode_level_video`: both must hold the same pixels.
            still.see(frame)
            if count <= len(out):
                out[count - 1] = convert(frame)
        still.hold(out)
        return count >= len(out)

    @property
    def lower_lid_layer(self) -> LowerLidLayer:
        """The lower-lid layer, read again at each call; InputError where the character has none.

        It knows this atlas: kept here, the two would hold one another's pictures in memory.
        """
        return LowerLidLayer(self)

    def forget_poses(self) -> None:
        """Give up the decoded video of the lower lid's poses; it is read again when asked for."""
        lower = self.declaration.lower_lid
        for file in {pose.file for pose in lower.poses} if lower else ():
            self._videos.pop(file, None)

    def fingerprint(self) -> str:
        """SHA-256 of the declaration and every picture file, in hexadecimal digits."""
        digest = hashlib.sha256((self.folder / DECLARATION_FILE).read_bytes())
        # Each file once, as levels may share a video.
        for file in dict.fromkeys(picture.file for picture in _pictures(self.declaration)):
            try:
                digest.update((self.folder / file).read_bytes())
            except OSError as error:
                raise InputError(
                    f"character '{self.name}': {file} is missing from {self.folder}; {REPAIR}"
                ) from error
        return digest.hexdigest()

    def check_files(self) -> None:
        """Decode every picture once; InputError names the first that is missing or damaged."""
        self.base_linear()
        for index in range(len(self.declaration.levels)):
            self.level_srgb(index)
        if self.has_lower_lid:
            for _ in self.lower_lid_layer.each_change():
                pass

    def _picture_or_frame(
        self, picture: PictureOrFrame, size: tuple[int, int], what: str
    ) -> NDArray[np.uint8]:
        if picture.frame is None:
            return self._decode(picture, size, what)
        if picture.file not in self._videos:
            content = declared_bytes(self.folder, picture, what)
            self._videos[picture.file] = decode_level_video(content, what, picture.file)
        frames, (width, height) = self._videos[picture.file], size
        if picture.frame >= len(frames) or frames.shape[1:3] != (height, width):
            raise InputError(
                f"{what}: {picture.file} holds {len(frames)} of {frames.shape[2]} x {frames.shape[1]} px, "
                f"but frame {picture.frame} of {width} x {height} px is declared"
            )
        return np.asarray(frames[picture.frame], np.uint8)

    def _decode(self, picture: Picture, size: Iterable[int], what: str) -> NDArray[np.uint8]:
        return decode_picture(self.folder, picture, tuple(size), what)


def load_atlas(folder: Path) -> Atlas:
    """Load a character's declaration; its pictures are decoded when asked for.

    Raises
    ------
    InputError
        The declaration is missing or wrong, or a declared file is not there.
    """
    declaration = read_declaration(folder)
    for picture in _pictures(declaration):
        if not (folder / picture.file).is_file():
            raise InputError(
                f"character '{declaration.name}': {picture.file} is missing from {folder}; bake it again or "
                f"correct {DECLARATION_FILE}"
            )
    return Atlas(folder, declaration)


def _pictures(declaration: Declaration) -> list[Picture]:
    """Base, levels, poses and mattes, in the order of the declaration."""
    lower = declaration.lower_lid
    pictures: list[Picture] = [declaration.base, *declaration.levels]
    return pictures if lower is None else [*pictures, *lower.poses, *lower.mattes]


# Characters that left the tree: a study made with one renders the same bytes once it is fetched.

RETIRED_FILE = Path(__file__).with_name("retired.toml")
ROOT = Path(__file__).resolve().parents[2]


class Retired(BaseModel):
    """Where a character lies in the repository's history, and the fingerprint of its pictures."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    label: str
    commit: str = Field(pattern="^[0-9a-f]{40}$")
    folder: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$")


def load_retired() -> dict[str, Retired]:
    """Every retired character by name."""
    content = tomllib.loads(RETIRED_FILE.read_text(encoding="utf-8"))
    return {name: Retired.model_validate(table) for name, table in content.items()}


def next_version(name: str) -> int:
    """The version that no character of that name has, here or in earlier releases; 1 for a new name."""
    known = {folder.name for folder in SHIPPED.iterdir()} | set(load_retired())
    numbers = [other.partition("@")[2] for other in known if other.partition("@")[0] == name]
    return max((int(number) if number.isdecimal() else 1 for number in numbers), default=0) + 1


# Decision 0695: A character's name means the same pictures for ever.
def restore(name: str, source: Path | None, target: Path) -> Path:
    """Put a retired character into the folder `target`, whole or not at all; returns that folder.

    Raises
    ------
    InputError
        There is no such character, the source does not hold it, its pictures are others than they were,
        or the folder cannot be written.
    """
    known = load_retired()
    if name not in known:
        raise InputError(f"there is no retired character '{name}'{did_you_mean(name, known)}")
    retired = known[name]
    if (target / DECLARATION_FILE).is_file():
        _check(name, retired, target)
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # In the folder of the target, since a rename to another disk is not possible.
        with tempfile.TemporaryDirectory(prefix=f".{name}-", dir=target.parent) as folder:
            draft = Path(folder) / "character"
            _take(name, retired, source or ROOT, draft)
            _check(name, retired, draft)
            draft.replace(target)
    except OSError as error:
        raise InputError(
            f"cannot write {target}: {error.strerror}; choose another folder with --out and use it as the "
            "character"
        ) from error
    return target


def _take(name: str, retired: Retired, source: Path, draft: Path) -> None:
    for folder in (source / retired.folder, source):
        if (folder / DECLARATION_FILE).is_file():
            shutil.copytree(folder, draft)
            return
    release = source
    if not source.is_file():
        release = draft.parent / "history.tar"
        release.write_bytes(_archive(name, retired, source))
    files = _files_in_release(name, retired, release)
    draft.mkdir()
    for path, data in files.items():
        (draft / path.rpartition("/")[2]).write_bytes(data)


UNREADABLE = (
    *(tarfile.TarError, zipfile.BadZipFile, zlib.error, lzma.LZMAError),
    *(EOFError, OSError, KeyError, RuntimeError),
)
"""Errors raised by damaged archives and by zip files with a password."""


def _files_in_release(name: str, retired: Retired, release: Path) -> dict[str, bytes]:
    """The character's files in a release file by their paths: a wheel or zip, or a source archive."""

    def belongs(path: str) -> bool:
        # Whatever folders are before it; a character's folder has no others in it.
        parent, _, file = path.rpartition("/")
        # A backslash would lead out of the folder on Windows.
        return bool(file) and "\\" not in file and f"/{parent}".endswith(f"/{retired.folder}")

    try:
        if zipfile.is_zipfile(release):
            with zipfile.ZipFile(release) as wheel:
                files = {path: wheel.read(path) for path in wheel.namelist() if belongs(path)}
        else:
            with tarfile.open(release) as tar:
                held = {one.name: tar.extractfile(one) for one in tar.getmembers() if belongs(one.name)}
                files = {path: content.read() for path, content in held.items() if content is not None}
    except UNREADABLE as error:
        raise InputError(
            f"{release}: expected a release file (.whl, .tar.gz or .zip) that can be read: {error}"
        ) from error
    if not files:
        raise InputError(
            f"{release} does not contain '{name}' ({retired.folder}): use the file of a release that had it"
        )
    return files


def _archive(name: str, retired: Retired, source: Path) -> bytes:
    """The character's folder as the commit that made it had it, in a tar file."""
    command = ["git", "-C", str(source), "archive", "--format=tar", retired.commit, retired.folder]
    try:
        done = subprocess.run(command, capture_output=True, check=False)  # noqa: S603 - fixed arguments
    except OSError as error:
        raise InputError(f"fetching '{name}' needs git, which was not found: {error.strerror}") from error
    if done.returncode:
        said = (done.stderr.decode(errors="replace").strip().splitlines() or ["no message"])[-1]
        raise InputError(
            f"{source} does not contain '{name}' ({said}): use --from with a complete clone of Palpebra "
            "(complete it with `git fetch --unshallow`) or an earlier release"
        )
    return done.stdout


def _check(name: str, retired: Retired, folder: Path) -> None:
    if load_atlas(folder).fingerprint() != retired.sha256:
        raise InputError(
            f"'{name}' in {folder} differs from the one in earlier releases: its pictures have another "
            "SHA-256; use an unchanged clone or release"
        )
