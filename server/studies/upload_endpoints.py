"""Uploads of own clips, and the originals of those that were converted."""

import csv
import io
from collections.abc import Iterable
from typing import Annotated

from fastapi import APIRouter, Form, UploadFile
from fastapi.params import File
from fastapi.responses import FileResponse, PlainTextResponse, StreamingResponse

from experiments.source_video import FrameRate
from server.accounts.identity import Identity
from server.accounts.permission import Viewer
from server.context import Services, ServicesDep
from server.errors import ERROR_RESPONSES, Invalid
from server.studies import left_out, originals, uploads
from server.studies.clip_schemas import AskFrameRate, LeaveOut, UploadOut, UploadProgress
from server.studies.upload_quota import Quota
from server.transcoding.records import ask_rate
from server.workspaces.access import Uploader

router = APIRouter(prefix="/api/admin", tags=["studies"], responses=ERROR_RESPONSES)


@router.post("/uploads", status_code=201)
def upload_clips(
    services: ServicesDep,
    identity: Uploader,
    files: Annotated[list[UploadFile] | None, File()] = None,
    fps: Annotated[FrameRate | None, Form()] = None,
) -> UploadOut:
    """Begin an upload: videos, a CSV table, or a zip of them. It waits a day to become a study.

    Videos are looked into, and converted where browsers cannot play them, after the answer: see the progress.
    """
    quota, limit = _quota(services, identity), services.settings.max_upload_bytes
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


@router.post("/uploads/{upload}/files")
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
    quota, sent, limit = _quota(services, identity), files or [], services.settings.max_upload_bytes
    if replaces is not None:
        if len(sent) != 1:
            raise Invalid(f"Expected one file in the place of '{replaces[:100]}', got {len(sent)}.")
        uploads.replace(folder, replaces, sent[0].filename or "", sent[0].file, limit, quota)
        sent = []
    for file in sent:
        uploads.receive_more(folder, file.filename or "", file.file, limit, quota)
    return _progress(services, upload, identity.account_id)


@router.get("/uploads/{upload}")
def get_upload(services: ServicesDep, identity: Uploader, upload: str) -> UploadOut:
    """Every file of an upload: what it is, how it was changed, or why it cannot be used."""
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    return uploads.describe(upload, folder)


@router.get("/uploads/{upload}/clips/{sha256}", response_class=FileResponse)
def get_uploaded_clip(services: ServicesDep, identity: Uploader, upload: str, sha256: str) -> FileResponse:
    """A clip of an upload as participants would get it, so that the experimenter's browser can try it."""
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    headers = {"content-disposition": "attachment", "cache-control": "private, no-store"}
    return FileResponse(uploads.find_clip(folder, sha256), 200, headers, "application/octet-stream")


@router.get("/uploads/{upload}/progress")
def upload_progress(services: ServicesDep, identity: Uploader, upload: str) -> UploadProgress:
    """How far an upload has been looked into and converted."""
    return _progress(services, upload, identity.account_id)


@router.put("/uploads/{upload}/frame-rate")
def ask_frame_rate(
    services: ServicesDep, identity: Uploader, upload: str, body: AskFrameRate
) -> UploadProgress:
    """Ask for one frame rate of all clips, or for each its own; they are looked into again."""
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    ask_rate(folder, body.fps)
    return _progress(services, upload, identity.account_id)


@router.put("/uploads/{upload}/left-out")
def leave_file_out(services: ServicesDep, identity: Uploader, upload: str, body: LeaveOut) -> UploadProgress:
    """Leave one file of an upload out, or put it back; its bytes stay as long as the upload does."""
    folder = uploads.upload_folder(services.settings.upload_folder, upload, identity.account_id)
    (left_out.leave_out if body.left_out else left_out.put_back)(folder, body.file)
    return _progress(services, upload, identity.account_id)


def _quota(services: Services, identity: Identity) -> Quota:
    settings = services.settings
    return Quota(settings.upload_folder, identity.account_id, settings.max_uploads_bytes)


def _progress(services: Services, upload: str, account: int) -> UploadProgress:
    folder = uploads.upload_folder(services.settings.upload_folder, upload, account)
    told = uploads.progress(folder)
    if told.waiting:
        services.preparing.begin()
    return told


@router.get("/studies/{study}/originals/{sha256}", response_class=StreamingResponse)
def get_original(services: ServicesDep, identity: Viewer, study: str, sha256: str) -> StreamingResponse:
    """The file that a converted clip was made from, as it was sent."""
    with services.database.read() as session:
        source = originals.find_source(session, study, sha256, identity)
    headers = {"content-disposition": originals.disposition(source.file), "content-length": str(source.bytes)}
    return StreamingResponse(
        services.clips.read(sha256, 0, source.bytes), 200, headers, "application/octet-stream"
    )


@router.get("/studies/{study}/originals/{sha256}/frame-map.csv", response_class=PlainTextResponse)
def get_frame_map(services: ServicesDep, identity: Viewer, study: str, sha256: str) -> PlainTextResponse:
    """For each frame of a converted clip the frame of its original that it shows, both from 0."""
    with services.database.read() as session:
        source = originals.find_source(session, study, sha256, identity)
    shown = source.frame_map or range(source.frames)
    headers = {"content-disposition": originals.disposition(f"{source.file}.frame-map.csv")}
    return PlainTextResponse(_frame_map_csv(shown), 200, headers, "text/csv")


def _frame_map_csv(shown: Iterable[int]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([("frame", "original_frame"), *enumerate(shown)])
    return text.getvalue()
