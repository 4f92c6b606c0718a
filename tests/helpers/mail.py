"""A real SMTP server on this machine, and what came to it."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from email import message_from_bytes, policy
from email.message import EmailMessage
from typing import Any

from aiosmtpd.controller import Controller

ADDRESS = "ada@lab.example"
"""Of the account whose letters are read."""


class Letterbox:
    """What came, in order."""

    def __init__(self) -> None:
        self.letters: list[EmailMessage] = []

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        letter = message_from_bytes(envelope.content, policy=policy.default)
        assert isinstance(letter, EmailMessage)
        assert envelope.rcpt_tos == [letter["To"]]
        self.letters.append(letter)
        return "250 taken"

    def token(self) -> str:
        """The token of the link in the latest letter."""
        body = self.letters[-1].get_content()
        [token] = re.findall(r"#([\w-]+)", body)
        return str(token)


class _OnFreePort(Controller):
    def _trigger_server(self) -> None:
        self.port = self.server.sockets[0].getsockname()[1]
        super()._trigger_server()


@contextmanager
def smtp_server(**options: Any) -> Iterator[tuple[Letterbox, int]]:
    """A server that takes every letter, and its port."""
    box = Letterbox()
    controller = _OnFreePort(box, hostname="127.0.0.1", port=0, **options)
    controller.start()
    try:
        yield box, controller.port
    finally:
        controller.stop()
