"""Answers with trials, as the page that asked reads them.

A page says that it knows where a clip is from its hash (`clips=hash` in Accept). One that was open before the
server learned this says nothing, and is told of each clip's address and size.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from fastapi import Request
from fastapi.responses import JSONResponse

from server.clips.address import clip_address
from server.context import Services
from server.finished import Answer, finished
from server.participants.lookup import find_run
from server.versions import LoadedVersion, PlacedClip

KNOWS_ADDRESSES = "clips=hash"
_SIZE = ("width_px", "height_px", "width_mm")


def finished_for_page(
    services: Services, request: Request, token: str, answer: Answer, status: int = 200, exclude: Any = None
) -> Answer:
    """The answer as a response, with addresses and sizes of clips where the page does not know them."""
    if KNOWS_ADDRESSES in request.headers.get("accept", ""):
        return finished(answer, status, exclude)
    content = answer.model_dump(mode="json", exclude=exclude)
    if trials := list(_trials(content)):
        with services.database.read() as session:
            loaded = services.versions.get(session, find_run(session, token).version_id)
        clips = {clip.sha256: clip for clip in loaded.clips.values()}
        for trial in trials:
            _tell_all(trial, clips, loaded)
    return JSONResponse(content, status)  # type: ignore[return-value]


def _trials(content: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The trials of a run, of the run within an answer to a form, or of those that follow a rating."""
    for told in (content, content.get("run"), content.get("next")):
        if told:
            yield from told.get("trials", ())


def _tell_all(trial: dict[str, Any], clips: Mapping[str, PlacedClip], loaded: LoadedVersion) -> None:
    first = clips.get(trial["clip_sha256"])
    trial["clip_url"], trial["bytes"] = (clip_address(first.sha256), first.bytes) if first else (None, None)
    for told in trial["clips"]:
        clip = clips[told["clip_sha256"]]
        told["clip_url"] = clip_address(clip.sha256)
        told.update((name, getattr(clip, name)) for name in _SIZE)
        told["inter_ocular_px"] = loaded.inter_ocular_px
