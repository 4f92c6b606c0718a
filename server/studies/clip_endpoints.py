"""Uploads of own clips and their originals, and clips by the hash of their bytes."""

import csv
import io
import re
from collections.abc import Iterable
from typing import Annotated, Any

from fastapi import APIRouter, Form, Header, Path, Response, UploadFile
from fastapi.params import File
from fastapi.responses import FileResponse, PlainTextResponse, RedirectResponse, StreamingResponse

from experiments.manifest import FrameRate
from server.accounts.access import Viewer
from server.accounts.identity import Identity
from server.accounts.workspaces import Uploader
from server.context import ServicesDep
from server.core.errors import ERROR_RESPONSES, ApiError, Invalid, NotFound
from server.core.requests import DatabaseDep, SettingsDep
from server.core.settings import Settings
from server.core.storage import CHUNK_BYTES
from server.studies import uploads
from server.studies.schemas import AskFrameRate, LeaveOut, UploadOut, UploadProgress
from server.studies.uploads import Quota
from server.transcoding.preparing import UploadPreparation
from server.transcoding.records import ask_rate

# Uploads of own clips, and the originals of those that were converted.

upload_router = APIRouter(prefix="/api/admin", tags=["studies"], responses=ERROR_RESPONSES)


@upload_router.post("/uploads", status_code=201)
def upload_clips(
    services: ServicesDep,
    identity: Uploader,
    files: Annotated[list[UploadFile] | None, File()] = None,
    fps: Annotated[FrameRate | None, Form()] = None,
) -> UploadOut:
    """Begin an upload: videos, a CSV table, or a zip of them. It waits a day to become a study.

    Videos are looked into, and converted where browsers cannot play them, after the answer: see the progress.
    """
    quota, limit = _quota(services.settings, identity), services.settings.max_upload_bytes
    identifier, folder = uploads.new_upload(quota, fps)
    try:
        for file in files or []:
            uploads.receive(folder, file.filename or "", file.file, limit, quota)
        described = uploads.describe(identifier, folder)
    except BaseException:
        uploads.discard(folder)
        raise
    services.preparing.begin()
    return described


@upload_router.post("/uploads/{upload}/files")
def upload_more(
    services: ServicesDep,
    identity: Uploader,
    upload: str,
    files: Annotated[list[UploadFile] | None, File()] = None,
    replaces: Annotated[str | None, Form()] = None,
) -> UploadProgress:
    """Send more files of an upload; those that have come already are passed over.

    With `replaces`, the one file that is sent takes the place of that file, which may have been refused.
    """
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    uploads.check_room(folder)
    quota, sent, limit = _quota(services.settings, identity), files or [], services.settings.max_upload_bytes
    if replaces is not None:
        if len(sent) != 1:
            raise Invalid(f"Expected one file in the place of '{replaces[:100]}', got {len(sent)}.")
        uploads.replace(folder, replaces, sent[0].filename or "", sent[0].file, limit, quota)
        sent = []
    for file in sent:
        uploads.receive_more(folder, file.filename or "", file.file, limit, quota)
    return _progress(services.settings, services.preparing, upload, identity.account_id)


@upload_router.get("/uploads/{upload}")
def get_upload(settings: SettingsDep, identity: Uploader, upload: str) -> UploadOut:
    """Every file of an upload: what it is, how it was changed, or why it cannot be used."""
    folder = uploads.upload_folder(settings.upload_folder, upload, identity.account_id)
    return uploads.describe(upload, folder)


@upload_router.get("/uploads/{upload}/clips/{sha256}", response_class=FileResponse)
def get_uploaded_clip(settings: SettingsDep, identity: Uploader, upload: str, sha256: str) -> FileResponse:
    """A clip of an upload as participants would get it, so that the experimenter's browser can try it."""
    folder = uploads.upload_folder(settings.upload_folder, upload, identity.account_id)
    headers = {"content-disposition": "attachment", "cache-control": "private, no-store"}
    return FileResponse(uploads.find_clip(folder, sha256), 200, headers, "application/octet-stream")


@upload_router.get("/uploads/{upload}/progress")
def upload_progress(services: ServicesDep, identity: Uploader, upload: str) -> UploadProgress:
    """How far an upload has been looked into and converted."""
    return _progress(services.settings, services.preparing, upload, identity.account_id)


@upload_router.put("/uploads/{upload}/frame-rate")
def ask_frame_rate(
    services: ServicesDep, identity: Uploader, upload: str, body: AskFrameRate
) -> UploadProgress:
    """Ask for one frame rate of all clips, or for each its own; they are looked into again."""
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    ask_rate(folder, body.fps)
    return _progress(services.settings, services.preparing, upload, identity.account_id)


@upload_router.put("/uploads/{upload}/left-out")
def leave_file_out(services: ServicesDep, identity: Uploader, upload: str, body: LeaveOut) -> UploadProgress:
    """Leave one file of an upload out, or put it back; its bytes stay as long as the upload does."""
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    (uploads.leave_out if body.left_out else uploads.put_back)(folder, body.file)
    return _progress(services.settings, services.preparing, upload, identity.account_id)


def _quota(settings: Settings, identity: Identity) -> Quota:
    return Quota(settings.upload_folder, identity.account_id, settings.max_uploads_bytes)


def _progress(settings: Settings, preparing: UploadPreparation, upload: str, account: int) -> UploadProgress:
    folder = uploads.upload_folder(settings.upload_folder, upload, account)
    told = uploads.progress(folder)
    if told.waiting:
        preparing.begin()
    return told


@upload_router.get("/studies/{study}/originals/{sha256}", response_class=StreamingResponse)
def get_original(services: ServicesDep, identity: Viewer, study: str, sha256: str) -> StreamingResponse:
    """The file that a converted clip was made from, as it was sent."""
    with services.database.read() as session:
        source = uploads.find_source(session, study, sha256, identity)
    headers = {
        "content-disposition": uploads.content_disposition(source.file),
        "content-length": str(source.bytes),
    }
    return StreamingResponse(
        services.clips.read(sha256, 0, source.bytes), 200, headers, "application/octet-stream"
    )


@upload_router.get("/studies/{study}/originals/{sha256}/frame-map.csv", response_class=PlainTextResponse)
def get_frame_map(database: DatabaseDep, identity: Viewer, study: str, sha256: str) -> PlainTextResponse:
    """For each frame of a converted clip the frame of its original that it shows, both from 0."""
    with database.read() as session:
        source = uploads.find_source(session, study, sha256, identity)
    shown = source.frame_map or range(source.frames)
    headers = {"content-disposition": uploads.content_disposition(f"{source.file}.frame-map.csv")}
    return PlainTextResponse(_frame_map_csv(shown), 200, headers, "text/csv")


def _frame_map_csv(shown: Iterable[int]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([("frame", "original_frame"), *enumerate(shown)])
    return text.getvalue()


# Clips by the hash of their bytes: cached for ever, in parts where asked.

clip_router = APIRouter(tags=["clips"], responses=ERROR_RESPONSES)
IMMUTABLE = "public, max-age=31536000, immutable"
REDIRECT_KEPT_S = 1800
"""Half of what a signed URL of `server.core.storage` is good for."""
_RANGE = re.compile(r"^bytes=([0-9]{0,15})-([0-9]{0,15})$")
_CLIP_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"content": {"video/mp4": {"schema": {"type": "string", "format": "binary"}}}},
    206: {"description": "The part asked for by Range"},
    304: {"description": "The copy the client has is right"},
    307: {"description": "The clip is to be fetched from the object store"},
}


class ClipUnknown(NotFound, code="clip_unknown"):
    """No clip has this hash."""


class RangeNotSatisfiable(ApiError, status=416, code="range_not_satisfiable"):
    """The part asked for lies outside the clip."""


@clip_router.get("/clips/{sha256}.mp4", response_class=Response, responses=_CLIP_ANSWERS)
@clip_router.head("/clips/{sha256}.mp4", include_in_schema=False)
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
            f"Expected a range within the clip's {size} bytes, got one from byte {start}.",
            headers={"content-range": f"bytes */{size}"},
        )
    return start, end
