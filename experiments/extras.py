"""Optional packages: which extra brings them, and the line that installs it."""

EXTRAS: dict[str, tuple[str, ...]] = {
    "track": ("numba", "cv2"),
    "render": ("numba", "cv2", "skia", "webrtcvad"),
    "s3": ("boto3",),
    "dask": ("distributed",),
}
"""Extra -> the modules that it brings."""


def install_line(extra: str | None = None) -> str:
    """The command that installs Palpebra, or it with an extra; it comes as a file, not from an index."""
    return f"uv tool install 'FILE.whl[{extra}]'" if extra else "uv tool install FILE.whl"


def missing_extra(module: str) -> str | None:
    """The install line for a module that is not there; None if no extra brings it.

    Parameters
    ----------
    module : str
        Name that could not be imported, such as `cv2` or `numba.core`.

    Returns
    -------
    str or None

    Examples
    --------
    >>> missing_extra("skia")
    "this command needs the extra 'render'; install Palpebra with it: uv tool install 'FILE.whl[render]'"
    >>> missing_extra("antigravity") is None
    True
    """
    top = module.partition(".")[0]
    for extra in ("render", "s3", "dask"):
        if top in EXTRAS[extra]:
            return f"this command needs the extra '{extra}'; install Palpebra with it: {install_line(extra)}"
    return None
