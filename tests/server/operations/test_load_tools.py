"""The tools that measure the server under load and attack do what their tables say they did."""

import asyncio
import socket
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench import attack, clip_load
from bench.load import divided
from bench.raters import Tally, begin, prepare, run, stored
from bench.servers import CLIP_BYTES, LoadServer, load_server, nginx, nginx_program
from tests.helpers.attacked import api_token
from tests.helpers.waiting import run_in_own_loop

RATERS, SECONDS, EVERY_S = 4, 3.0, 0.5
STATUSES = {
    "half a surrogate pair, 50/s": {"422"},
    "guessed invitations, 50/s": {"404", "429"},
    "dashboards, 10 pages/s": {"200"},
    "run starts, 10/s": {"201"},
    "two lengths, or a length and chunks, 50/s": {"400"},
    "ranges of clips that no player asks for, 100/s": {"200", "206", "416"},
    "300 MB of zeros in a zip, SVG as clips, 4/s": {"422"},
    "reports of links that do not exist, 100/s": {"404"},
    "device reports of 30 kB, 50/s": {"200", "413"},
}
"""What these come to; the others' answers depend on how busy the machine is."""


@pytest.fixture(scope="module")
def server() -> Iterator[LoadServer]:
    with load_server("sqlite", 1) as started:
        yield started


@pytest.fixture(scope="module")
def target(server: LoadServer) -> attack.Target:
    owner = api_token(server.opened, "read", "personal", "write", "export", name="owner")

    async def token() -> str:
        return await attack.run_of_attacker(server)

    return attack.Target(
        server.port, server.link_token, owner, run_in_own_loop(token()), attack.a_clip(server)
    )


def test_the_raters_of_load_rate_and_everything_is_stored(server: LoadServer) -> None:
    tally = Tally()

    async def go() -> None:
        raters = await begin(server, RATERS, tally, RATERS)
        await prepare(raters)
        ends = time.monotonic() + SECONDS
        await asyncio.gather(*(rater.rate_until(ends, EVERY_S) for rater in raters))

    run(go())
    assert tally.failed_starts == 0
    assert len(tally.acknowledged) == len(tally.rating_ms) >= RATERS
    assert len(tally.clip_ms) > 0
    assert stored(server, tally) == (0, 0)


def test_a_rating_that_was_acknowledged_and_is_not_there_is_reported(server: LoadServer) -> None:
    assert stored(server, Tally(acknowledged={"00000000-0000-4000-8000-000000000000": 4})) == (1, 0)


def test_a_rating_counts_for_a_snapshot_that_it_was_under_way_with() -> None:
    tally = Tally(rating_at=[0.5, 0.9, 1.5, 2.1], rating_ms=[100.0, 200.0, 5.0, 7.0])
    assert divided(tally, [(1.0, 2.0)]) == ([200.0, 5.0], [100.0, 7.0])


@pytest.mark.parametrize("name", attack.ATTACKS)
def test_each_attack_reaches_the_server(target: attack.Target, name: str) -> None:
    answers: dict[str, int] = {}
    for seconds in (0.5, 4.0, 16.0, 64.0):  # a busy machine answers late, and what is sent is made first
        if not answers:
            answers = run_in_own_loop(attack.ATTACKS[name](target, time.monotonic() + seconds))
    assert sum(answers.values()) > 0, answers
    if name in STATUSES:
        assert set(answers) <= STATUSES[name]


def fetched_by_urllib(port: int, path: str) -> bytes:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}") as answer:
        content: bytes = answer.read()
    return content


def test_clips_as_fast_as_they_come_are_whole_ones_and_counted(server: LoadServer) -> None:
    paths = clip_load.addresses(server)
    assert 0 < len(paths) == len(set(paths)) <= clip_load.CLIPS_ASKED_FOR
    assert len(fetched_by_urllib(server.port, paths[0])) == CLIP_BYTES
    before = server.cpu_s()
    got = clip_load.measured(server.port, paths, 1.0, server.cpu_s)
    assert got.clips > 0
    assert got.seconds >= 1.0
    assert 0 < got.sender_s <= server.cpu_s() - before
    assert got.per_core_s == pytest.approx(got.clips / got.sender_s)


def test_clips_by_way_of_nginx_are_counted_as_nginxs(server: LoadServer, tmp_path: Path) -> None:
    program = nginx_program()
    if program is None:
        pytest.skip("nginx is not installed here")
    paths = clip_load.addresses(server)
    with nginx(program, tmp_path, server.port) as proxy:
        got = clip_load.measured(proxy.port, paths, 1.0, proxy.cpu_s)
        servers_own = server.cpu_s()
        again = clip_load.measured(proxy.port, paths, 1.0, proxy.cpu_s)
        servers_own = server.cpu_s() - servers_own
    assert min(got.clips, again.clips) > 0
    # What nginx has it sends by itself: the server's part is that of a server that does nothing else.
    assert servers_own < again.sender_s


class _Answers(threading.Thread):
    """One connection that is answered so, and closed."""

    def __init__(self, answer: bytes) -> None:
        super().__init__(daemon=True)
        self.listener, self.answer = socket.create_server(("127.0.0.1", 0)), answer

    def run(self) -> None:
        with self.listener:
            connection, _ = self.listener.accept()
        with connection:
            connection.recv(4096)
            connection.sendall(self.answer)


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"HTTP/1.1 404 Not Found\r\ncontent-length: 2\r\n\r\nno", "expected a clip"),
        (b"HTTP/1.1 200 OK\r\ncontent-length: 9\r\n\r\nabc", "ended within a clip"),
    ],
)
def test_what_is_not_a_whole_clip_is_not_counted(answer: bytes, said: str) -> None:
    answering = _Answers(answer)
    answering.start()
    with socket.create_connection(answering.listener.getsockname()) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
        with pytest.raises(RuntimeError, match=said):
            clip_load._take(connection, memoryview(bytearray(1024)))


def test_a_connection_closed_between_two_clips_counts_nothing() -> None:
    answering = _Answers(b"")
    answering.start()
    with socket.create_connection(answering.listener.getsockname()) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert clip_load._take(connection, memoryview(bytearray(1024))) is False


def test_a_clip_in_two_pieces_behind_its_head_is_one() -> None:
    content = bytes(range(256)) * 20
    answering = _Answers(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % len(content) + content)
    answering.start()
    with socket.create_connection(answering.listener.getsockname()) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert clip_load._take(connection, memoryview(bytearray(1024))) is True
        assert connection.recv(10) == b""
