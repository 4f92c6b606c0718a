"""What one run may hold, what others on the machine may read, and a store that hangs."""

import socket
import threading
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from server.context import Services
from server.core import storage
from server.core.settings import Settings
from server.core.storage import ClipsAway, open_to_others
from server.models import StudyRun
from server.participation import current_run
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant


def test_device_reports_do_not_grow_without_end(participant: Participant, services: Services) -> None:
    participant.agree()
    refused = set()
    for number in range(60):
        body = {f"{number}-{key}": "x" * 1000 for key in range(40)}
        answer = participant.request("PUT", "/device", body)
        if answer.status_code != 200:
            refused.add((answer.status_code, answer.json()["error"]["code"]))
    assert refused == {(413, "run_data_too_large")}
    assert participant.request("PUT", "/device", {"agent": "Firefox"}).status_code == 200
    deep: list[object] = []
    for _ in range(400):
        deep = [deep]
    assert participant.request("PUT", "/device", {"deep": deep}).status_code == 413
    with services.database.read() as session:
        assert len(str(session.query(StudyRun).one().device)) < current_run.DEVICE_BYTES


def test_events_and_calibrations_are_bounded(
    participant: Participant, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(current_run, "EVENTS_A_RUN", 5)
    monkeypatch.setattr(current_run, "CALIBRATIONS_A_RUN", 2)
    participant.agree()

    def event(**data: str) -> dict[str, object]:
        return {"id": str(uuid.uuid4()), "type": "note", "data": data}

    assert participant.request("POST", "/events", {"events": [event(a="x" * 5000)]}).status_code == 413
    many = [participant.request("POST", "/events", {"events": [event()]}).status_code for _ in range(6)]
    assert many == [200] * 5 + [413]
    size = {
        "px_per_mm": 4,
        "method": "card",
        "device_pixel_ratio": 1,
        "screen_width_px": 9,
        "screen_height_px": 9,
    }
    size |= {"window_width_px": 9, "window_height_px": 9}
    assert [participant.request("PUT", "/calibration", size).status_code for _ in range(3)] == [200, 200, 413]


def test_nobody_else_on_the_machine_reads_the_data_folder(tmp_path: Path) -> None:
    settings = Settings(data_folder=tmp_path / "data", frontend_folder=tmp_path)
    assert run_server_command(settings, "database", "upgrade").returncode == 0
    assert list(open_to_others(settings.data_folder)) == []
    (settings.data_folder / "reports").mkdir(mode=0o755)
    left = settings.data_folder / "reports" / "report.html"
    left.write_text("x")
    left.chmod(0o644)
    assert {path.name for path in open_to_others(settings.data_folder)} >= {"report.html"}
    said = " ".join(run_server_command(settings, "doctor").stdout.split())
    assert "open to other users" in said
    assert "chmod -R go=" in said


def test_a_store_that_hangs_holds_neither_threads_nor_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("boto3")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "x")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "x")
    monkeypatch.setattr(storage, "READ_S", 1)
    monkeypatch.setattr(storage, "AWAY_S", 600)
    with silent_store() as (endpoint, asked):
        store = storage.open_s3(Settings(s3_bucket="clips", s3_endpoint=endpoint))

        def ask() -> None:
            with pytest.raises(ClipsAway):
                store.size("0" * 64)

        with ThreadPoolExecutor(40) as threads:
            for future in [threads.submit(ask) for _ in range(40)]:
                future.result()
        assert 1 <= len(asked) <= storage.AT_ONCE
        before = len(asked)
        assert store.problem(None)
        ask()
        assert len(asked) == before


@contextmanager
def silent_store() -> Iterator[tuple[str, list[socket.socket]]]:
    """An address that takes connections and never answers, and the connections it has taken."""
    taken: list[socket.socket] = []

    def take() -> None:
        with suppress(OSError):
            while True:
                taken.append(listening.accept()[0])

    with socket.create_server(("127.0.0.1", 0), backlog=64) as listening:
        thread = threading.Thread(target=take)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}", taken
        finally:
            listening.shutdown(socket.SHUT_RDWR)
            thread.join()
    for connection in taken:
        connection.close()
