"""Send clips as the page does, and wait until the server has looked into them."""

import time
from typing import Any

from tests.helpers.admins import Admin

PATIENCE_S = 120.0


def upload(admin: Admin, *files: tuple[str, bytes], fps: float | None = None) -> Any:
    """Send files; the answer of a refusal, else that of the upload once none of its files waits."""
    sent = [("files", file) for file in files]
    asked = {} if fps is None else {"fps": str(fps)}
    answer = admin.client.post("/api/admin/uploads", files=sent, data=asked)
    return answer if answer.status_code != 201 else looked_into(admin, answer.json()["id"])


def looked_into(admin: Admin, identifier: str) -> Any:
    """What an upload is once none of its files waits."""
    until = time.monotonic() + PATIENCE_S
    while admin.get(f"/uploads/{identifier}/progress").json()["waiting"]:
        assert time.monotonic() < until, "the clips were not looked into in time"
        time.sleep(0.02)
    return admin.get(f"/uploads/{identifier}")
