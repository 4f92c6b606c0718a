"""Clips by the hash of their bytes: cached for ever, in parts where asked."""

import re
from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Response
from fastapi.responses import RedirectResponse, StreamingResponse

from server.context import ServicesDep
from server.errors import ERROR_RESPONSES, ApiError, NotFound
from server.storage.clips import CHUNK_BYTES

router = APIRouter(tags=["clips"], responses=ERROR_RESPONSES)
IMMUTABLE = "public, max-age=31536000, immutable"
REDIRECT_KEPT_S = 1800
"""Half of what a signed address of `server.storage.s3` is good for."""
_RANGE = re.compile(r"^bytes=([0-9]{0,15})-([0-9]{0,15})$")
_CLIP_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"content": {"video/mp4": {"schema": {"type": "string", "format": "binary"}}}},
    206: {"description": "The part asked for by Range"},
    304: {"description": "The copy the client has is right"},
    307: {"description": "The clip is to be fetched from the object store"},
}


class ClipUnknown(NotFound):
    """No clip has this hash."""

    code = "clip_unknown"


class RangeNotSatisfiable(ApiError):
    """The part asked for lies outside the clip."""

    status = 416
    code = "range_not_satisfiable"


@router.get("/clips/{sha256}.mp4", response_class=Response, responses=_CLIP_ANSWERS)
@router.head("/clips/{sha256}.mp4", include_in_schema=False)
def get_clip(
    services: ServicesDep,
    sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")],
    range_header: Annotated[str | None, Header(alias="range")] = None,
    if_none_match: Annotated[str | None, Header()] = None,
    if_range: Annotated[str | None, Header()] = None,
) -> Response:
    """The clip's bytes, whole or the part that Range asks for."""
    size = services.clips.size(sha256)
    if size is None:
        raise ClipUnknown(f"No clip has the hash {sha256[:12]}...; reload the page to get the current list.")
    if address := services.clips.address(sha256):
        return RedirectResponse(address, 307, {"cache-control": f"private, max-age={REDIRECT_KEPT_S}"})
    etag = f'"{sha256}"'
    headers = {"etag": etag, "cache-control": IMMUTABLE, "accept-ranges": "bytes"}
    if if_none_match and (if_none_match.strip() == "*" or etag in if_none_match):
        return Response(status_code=304, headers=headers)
    part = _part(range_header, size) if range_header and if_range in (None, etag) else None
    start, end = part or (0, size)
    headers["content-length"] = str(end - start)
    if part is not None:
        headers["content-range"] = f"bytes {start}-{end - 1}/{size}"
    status = 206 if part is not None else 200
    pieces = services.clips.read(sha256, start, end)
    if end - start > CHUNK_BYTES:
        return StreamingResponse(pieces, status, headers, "video/mp4")
    return Response(b"".join(pieces), status, headers, "video/mp4")


def _part(header: str, size: int) -> tuple[int, int] | None:
    """Start and end (exclusive) of a single byte range; None where the header is of another kind."""
    match = _RANGE.match(header.replace(" ", ""))
    if match is None or (not match[1] and not match[2]):
        return None
    if not match[1]:
        start, end = max(0, size - int(match[2])), size
    else:
        start, end = int(match[1]), min(size, int(match[2]) + 1 if match[2] else size)
    if start >= end:
        raise RangeNotSatisfiable(
            f"The clip has {size} bytes; the part asked for lies outside.",
            headers={"content-range": f"bytes */{size}"},
        )
    return start, end
