"""Intel's Open Image Denoise, the library that Blender brings along, on pictures of our own making.

Blender denoises the whole picture alone; here the light below the skin and what shines above it are cleaned
apart, so that the skin's color between them keeps every pore. Runs under bpy: see cycles_face_worker.py.
"""

import ctypes
from ctypes import POINTER, byref, c_bool, c_char_p, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

import bpy
import numpy as np

CPU, FLOAT3 = 1, 3
"""Values of OIDNDeviceType and OIDNFormat of its C interface, version 2."""
SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "oidnNewDevice": (c_void_p, [c_int]),
    "oidnSetDeviceInt": (None, [c_void_p, c_char_p, c_int]),
    "oidnCommitDevice": (None, [c_void_p]),
    "oidnGetDeviceError": (c_int, [c_void_p, POINTER(c_char_p)]),
    "oidnNewFilter": (c_void_p, [c_void_p, c_char_p]),
    "oidnSetSharedFilterImage": (None, [c_void_p, c_char_p, c_void_p, c_int, *[c_size_t] * 5]),
    "oidnSetFilterBool": (None, [c_void_p, c_char_p, c_bool]),
    "oidnCommitFilter": (None, [c_void_p]),
    "oidnExecuteFilter": (None, [c_void_p]),
    "oidnReleaseFilter": (None, [c_void_p]),
}
NAMES = ("libOpenImageDenoise.so.2", "libOpenImageDenoise.2.dylib", "OpenImageDenoise.dll")


class Denoiser:
    """One device of the library, on `threads` threads; it lives as long as the process.

    Every call raises RuntimeError with the library's own words where it fails.
    """

    def __init__(self, threads: int) -> None:
        self._library = _load()
        self._device = self._library.oidnNewDevice(CPU)
        self._library.oidnSetDeviceInt(self._device, b"numThreads", threads)
        self._library.oidnCommitDevice(self._device)
        self._check()

    def guide(self, name: str, picture: Any) -> Any:
        """A guide ('albedo' or 'normal') without its own noise, (h, w, 3)."""
        return self._filtered({name: picture})

    def light(self, noisy: Any, albedo: Any, normal: Any) -> Any:
        """Light (h, w, 3), cleaned along the edges of two clean guides."""
        return self._filtered({"color": noisy, "albedo": albedo, "normal": normal}, hdr=True, cleanAux=True)

    def _filtered(self, pictures: dict[str, Any], **flags: bool) -> Any:
        pictures = {name: np.ascontiguousarray(picture, np.float32) for name, picture in pictures.items()}
        pictures["output"] = np.empty_like(next(iter(pictures.values())))
        library, made = self._library, self._library.oidnNewFilter(self._device, b"RT")
        try:
            for name, picture in pictures.items():
                height, width = picture.shape[:2]
                library.oidnSetSharedFilterImage(
                    made, name.encode(), picture.ctypes.data, FLOAT3, width, height, 0, 0, 0
                )
            for name, flag in flags.items():
                library.oidnSetFilterBool(made, name.encode(), flag)
            library.oidnCommitFilter(made)
            library.oidnExecuteFilter(made)
            self._check()
        finally:
            library.oidnReleaseFilter(made)
        return pictures["output"]

    def _check(self) -> None:
        message = c_char_p()
        if self._library.oidnGetDeviceError(self._device, byref(message)):
            raise RuntimeError(f"Open Image Denoise: {(message.value or b'no message').decode()}")


def _load() -> Any:
    """The library shipped with bpy, in `lib` of its wheel, above the scripts that `import bpy` reads."""
    wheel = Path(bpy.__file__).resolve().parents[4]
    files = [folder / name for folder in (wheel / "lib", wheel) for name in NAMES]
    file = next((file for file in files if file.exists()), None)
    if file is None:
        raise RuntimeError(f"no Open Image Denoise next to bpy in {wheel}")
    library = ctypes.CDLL(str(file))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
