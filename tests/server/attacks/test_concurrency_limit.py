"""Many requests of experimenters at once wait for one another; raters wait for none of them."""

import asyncio
from contextlib import suppress
from typing import Any

from server.request_limits import ConcurrencyLimit
from tests.helpers.waiting import run_in_own_loop

PAGE = "/api/admin/studies"


class Pages:
    """An application whose answers begin when the test says so."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.begins, self.ends = asyncio.Event(), asyncio.Event()
        self.breaks = False

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.begun.append(scope["path"])
        await self.begins.wait()
        if self.breaks:
            raise OSError("the client went away")
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await self.ends.wait()


async def _nothing(*_: Any) -> Any:
    return {}


def _asked(limit: ConcurrencyLimit, *paths: str) -> list[asyncio.Task[None]]:
    scopes = [{"type": "http", "method": "GET", "path": path} for path in paths]
    return [asyncio.ensure_future(limit(scope, _nothing, _nothing)) for scope in scopes]


async def _settled() -> None:
    for _ in range(20):
        await asyncio.sleep(0)


def test_two_are_served_and_the_third_waits_until_an_answer_begins() -> None:
    async def go() -> None:
        pages = Pages()
        limit = ConcurrencyLimit(pages, at_once=2)
        tasks = _asked(limit, PAGE, PAGE, PAGE, "/api/run", "/clips/a.mp4", "/api/admin/session")
        await _settled()
        assert pages.begun == [PAGE, PAGE, "/api/run", "/clips/a.mp4", "/api/admin/session"]
        pages.begins.set()  # the answers begin and stream on
        await _settled()
        assert pages.begun.count(PAGE) == 3
        pages.ends.set()
        await asyncio.gather(*tasks)

    run_in_own_loop(go())


def test_a_request_that_breaks_or_is_given_up_leaves_its_place() -> None:
    async def go() -> None:
        pages = Pages()
        pages.breaks = True
        limit = ConcurrencyLimit(pages, at_once=1)
        first, second = _asked(limit, PAGE, PAGE)
        await _settled()
        second.cancel()  # while it waits
        pages.begins.set()
        with suppress(OSError, asyncio.CancelledError):
            await asyncio.gather(first, second)
        pages.breaks = False
        pages.ends.set()
        await asyncio.wait_for(_asked(limit, PAGE)[0], 5)

    run_in_own_loop(go())
