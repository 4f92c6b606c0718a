"""A study of 5,000 converted clips: seconds to create it and to save a changed definition, and their ratio.

    python -m bench.study_creation [clips, default 5000]

The baseline of the ratio is what the server needs to say what the same upload holds, in the same run.
"""

import hashlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from experiments.manifest import SourceVideo
from server.accounts import invitations
from server.app import create_app
from server.cli_common import migrated_services
from server.core.settings import Settings
from server.studies import uploads
from server.studies.uploads import Quota
from server.transcoding.records import RECORDS
from tests.helpers.admins import PASSWORD
from video_conversion.prepared import Prepared

LIMIT_S = 5.0
FRAMES = 60


def prepared(folder: Path, number: int) -> Prepared:
    """One converted clip of an upload, as the worker leaves it; its bytes are noise."""
    name, content = f"s{number % 50}_e{number // 50:03d}.mp4", os.urandom(200)
    (folder / name).write_bytes(content)
    sha256 = hashlib.sha256(content).hexdigest()
    source = SourceVideo(
        file=name,
        sha256=hashlib.sha256(sha256.encode()).hexdigest(),
        bytes=len(content),
        container="matroska",
        codec="vp9",
        pixel_format="yuv420p",
        colour_range="limited",
        width_px=640,
        height_px=360,
        fps=29.97,
        variable_rate=True,
        frames=FRAMES + 1,
        changes=("VP9 became H.264",),
        encoded_again=True,
        frame_map=tuple(range(FRAMES)),
        lowest_psnr_db=42.1,
    )
    size = {"frames": FRAMES, "width_px": 640, "height_px": 360}
    return Prepared(
        name=name,
        asked_fps=None,
        clip=name,
        sha256=sha256,
        bytes=len(content),
        fps=30.0,
        source=source,
        **size,
    )


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    begun = time.monotonic()
    answer = call()
    if answer.status_code >= 400:
        sys.exit(answer.text)
    return time.monotonic() - begun, answer.json()


def measure(client: TestClient, upload: str) -> None:
    """Print one line per request."""
    baseline, _ = timed(lambda: client.get(f"/api/admin/uploads/{upload}"))
    body = {
        "name": "many",
        "upload": upload,
        "levels": {"pattern": "{speed}_{exemplar}.mp4"},
        "own_clips": {"title": "Many clips"},
    }
    created, study = timed(lambda: client.post("/api/admin/studies", json=body))
    toml = study["toml"].replace('"Many clips"', '"Very many clips"', 1)
    changed = {"revision": study["summary"]["revision"], "toml": toml}
    saved, _ = timed(lambda: client.post("/api/admin/studies/many/versions", json=changed))
    for name, seconds in (
        ("say what was uploaded", baseline),
        ("create", created),
        ("save a version", saved),
    ):
        within = "met" if seconds <= LIMIT_S else "missed"
        sys.stdout.write(
            f"{name:<24} {seconds:6.2f} s {seconds / baseline:6.1f} times  <= {LIMIT_S:g} s: {within}\n"
        )


def main() -> None:
    clips = int(sys.argv[1]) if len(sys.argv) > 1 else 5000
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(data_folder=Path(folder) / "data", public_url="http://testserver")
        settings.data_folder.mkdir()
        with migrated_services(settings) as services:
            link = invitations.invite(services.database, "owner", "", None)[1]
        client = TestClient(create_app(settings), headers={"origin": "http://testserver"})
        client.post(f"/api/admin/invitations/{link}/account", json={"name": "ada", "password": PASSWORD})
        upload, inside = uploads.new_upload(Quota(settings.upload_folder, 1, settings.max_uploads_bytes))
        lines = (json.dumps(prepared(inside, number).model_dump(mode="json")) for number in range(clips))
        (inside / RECORDS).write_text("\n".join(lines), encoding="utf-8")
        measure(client, upload)


if __name__ == "__main__":
    main()
