"""Where a clip is, whoever asks: pages know it from the clip's hash."""


def clip_address(sha256: str) -> str:
    """The path of a clip's bytes on this server."""
    return f"/clips/{sha256}.mp4"
