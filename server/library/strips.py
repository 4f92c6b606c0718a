"""The characters at closures from open to shut, for the blinks page: files that `stimuli strips` wrote."""

from pathlib import Path

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field, ValidationError

from server.accounts.permission import Viewer
from server.context import ServicesDep
from server.errors import ERROR_RESPONSES, NotFound

router = APIRouter(prefix="/api/admin/blinks/strips", tags=["blinks"], responses=ERROR_RESPONSES)
STRIPS_FILE = "strips.json"


class Strips(BaseModel):
    """Picture strips, one a character: frames of one size, one below the other."""

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    closures: list[float] = Field(description="Closure of each frame, ascending: 0 open, 1 shut.")
    characters: list[str] = Field(description="Their pictures are at …/strips/NAME.webp.")


@router.get("")
def get_strips(services: ServicesDep, _identity: Viewer) -> Strips:
    """What strips there are; none where they have not been made on this server."""
    strips = _declared(services.settings.strips_folder)
    return strips or Strips(width_px=1, height_px=1, closures=[], characters=[])


@router.get("/{name}.webp", response_class=Response)
def get_strip(services: ServicesDep, _identity: Viewer, name: str) -> Response:
    """The strip of one character."""
    folder = services.settings.strips_folder
    strips = _declared(folder)
    if strips is None or name not in strips.characters:
        raise NotFound(
            f"There is no picture strip of '{name}'; run `stimuli strips --out DATA_FOLDER/stimuli/strips`."
        )
    content = (folder / f"{name}.webp").read_bytes()
    return Response(content, media_type="image/webp", headers={"cache-control": "private, no-cache"})


def _declared(folder: Path) -> Strips | None:
    """The declaration; None where there is none, it is not readable or a picture is missing."""
    try:
        declared = Strips.model_validate_json((folder / STRIPS_FILE).read_bytes())
    except (OSError, ValidationError):
        return None
    whole = all((folder / f"{Path(name).name}.webp").is_file() for name in declared.characters)
    return declared if whole else None
