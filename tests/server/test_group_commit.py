import asyncio
import threading
from itertools import groupby
from typing import Any

import pytest
from sqlalchemy import Connection, text
from sqlalchemy.exc import IntegrityError

from server.core.commit import MAX_HEAVY, MAX_LIGHT, GroupCommit
from server.core.errors import Conflict
from tests.helpers.waiting import run_in_own_loop

INSERT = text("INSERT INTO clips VALUES (:name, 1, 30, 1, 1, 1, '2026-11-21 00:00:00')")


@pytest.fixture
def writers(services):
    group = GroupCommit(services.database)
    yield group
    group.close()


def stored(services) -> set[str]:
    with services.database.read() as session:
        return set(session.scalars(text("SELECT sha256 FROM clips")))


def insert(name: str):
    return lambda connection: connection.execute(INSERT, {"name": name}).rowcount


def test_each_gets_its_own_result_after_the_commit(writers, services) -> None:
    async def main() -> list[str]:
        async def one(number: int) -> str:
            await writers.run(str(number), insert(f"clip{number}"))
            assert f"clip{number}" in stored(services)
            return f"clip{number}"

        return await asyncio.gather(*(one(number) for number in range(50)))

    assert set(run_in_own_loop(main())) == stored(services)


def test_a_refusal_reaches_the_one_and_spares_the_others(writers, services) -> None:
    def refuse(_: Connection) -> None:
        raise Conflict("no")

    async def main() -> list[object]:
        work = [insert("a"), refuse, insert("b")]
        return await asyncio.gather(*(writers.run("k", do) for do in work), return_exceptions=True)

    results = run_in_own_loop(main())
    assert [type(result) for result in results] == [int, Conflict, int]
    assert stored(services) == {"a", "b"}


def test_what_breaks_the_transaction_is_undone_alone(writers, services) -> None:
    def fail(connection: Connection) -> None:
        connection.execute(INSERT, {"name": "half"})
        raise RuntimeError("broken")

    async def main() -> list[object]:
        work = [insert("a"), fail, insert("a"), insert("b")]
        return await asyncio.gather(*(writers.run("k", do) for do in work), return_exceptions=True)

    results = run_in_own_loop(main())
    assert results[0] == results[3] == 1
    assert isinstance(results[1], RuntimeError)
    assert isinstance(results[2], IntegrityError)
    assert stored(services) == {"a", "b"}


def test_closing_finishes_what_waits(writers, services) -> None:
    async def main() -> None:
        tasks = [asyncio.create_task(writers.run("k", insert(f"c{number}"))) for number in range(20)]
        await asyncio.sleep(0)
        await asyncio.to_thread(writers.close)
        await asyncio.gather(*tasks)

    run_in_own_loop(main())
    assert len(stored(services)) == 20


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_light_work_passes_heavy_work_however_long_that_has_waited(writers, services) -> None:
    """The first piece occupies the one writer until everything else waits (PostgreSQL has two kinds)."""
    began, occupied, order = threading.Event(), threading.Event(), []

    def occupy(_: Any) -> None:
        began.set()
        occupied.wait(60)

    def note(name: str):
        return lambda connection: order.append((name, connection.get_transaction()))

    async def main() -> None:
        first = asyncio.create_task(writers.run("k", occupy))
        assert await asyncio.to_thread(began.wait, 60)
        tasks = [asyncio.create_task(writers.run("k", note("heavy"), MAX_HEAVY // 2)) for _ in range(6)]
        await asyncio.sleep(0.4)
        tasks += [asyncio.create_task(writers.run("k", note("light"))) for _ in range(3)]
        await asyncio.sleep(0)
        occupied.set()
        await asyncio.gather(first, *tasks)

    run_in_own_loop(main())
    assert [name for name, _ in order] == ["light"] * 3 + ["heavy"] * 6
    transactions = [list(group) for _, group in groupby(order, lambda noted: id(noted[1]))]
    assert [len(group) for group in transactions] == [5, 2, 2]


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_heavy_work_gets_its_share_while_light_work_never_ceases(writers, services) -> None:
    done: list[str] = []

    async def main() -> None:
        async def light() -> None:
            while "heavy" not in done:
                await writers.run("k", lambda _: None)

        raters = [asyncio.create_task(light()) for _ in range(2 * MAX_LIGHT)]
        await asyncio.sleep(0.05)
        await asyncio.wait_for(writers.run("k", lambda _: done.append("heavy"), 2 * MAX_HEAVY), 10)
        await asyncio.gather(*raters)

    run_in_own_loop(main())
    assert done == ["heavy"]


@pytest.mark.postgres
@pytest.mark.parametrize("database_url", ["postgres"], indirect=True)
def test_postgres_does_light_work_while_heavy_work_waits(writers, services) -> None:
    stuck = threading.Event()

    async def main() -> None:
        heavy = asyncio.create_task(writers.run("k", lambda _: stuck.wait(10), 2))
        await asyncio.wait_for(writers.run("k", insert("light")), 5)
        assert not heavy.done()
        stuck.set()
        await heavy

    run_in_own_loop(main())
    assert stored(services) == {"light"}
