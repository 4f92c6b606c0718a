"""The tools that measure the server under load and attack do what their tables say they did."""

import asyncio
import time
from collections.abc import Iterator

import pytest

from tests.helpers.attacked import api_token
from tools import attack, attacks
from tools.load_client import Tally
from tools.load_measures import stored
from tools.load_scenarios import begin, prepare, run
from tools.load_server import LoadServer, load_server
from tools.load_snapshots import divided

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
def target(server: LoadServer) -> attacks.Target:
    owner = api_token(server.services, "read", "personal", "write", "export", name="owner")

    async def token() -> str:
        return await attack.run_of_attacker(server)

    return attacks.Target(server.port, server.link, owner, asyncio.run(token()), attack.a_clip(server))


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


def test_a_rating_that_was_acknowledged_and_is_not_there_is_told(server: LoadServer) -> None:
    assert stored(server, Tally(acknowledged={"00000000-0000-4000-8000-000000000000": 4})) == (1, 0)


def test_a_rating_counts_for_a_snapshot_that_it_was_under_way_with() -> None:
    tally = Tally(rating_at=[0.5, 0.9, 1.5, 2.1], rating_ms=[100.0, 200.0, 5.0, 7.0])
    assert divided(tally, [(1.0, 2.0)]) == ([200.0, 5.0], [100.0, 7.0])


@pytest.mark.parametrize("name", attacks.ATTACKS)
def test_each_attack_reaches_the_server(target: attacks.Target, name: str) -> None:
    seconds = 4.0 if name.startswith("300 ") else 0.5  # these wait for answers, or are made first
    answers = asyncio.run(attacks.ATTACKS[name](target, time.monotonic() + seconds))
    assert sum(answers.values()) > 0, answers
    if name in STATUSES:
        assert set(answers) <= STATUSES[name]
