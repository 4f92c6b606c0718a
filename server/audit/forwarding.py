"""Entries of the audit log to syslog, where `PALPEBRA_AUDIT_SYSLOG` names one."""

import json
import logging
import queue
import threading
from functools import lru_cache
from logging.handlers import SysLogHandler
from pathlib import Path

from experiments.errors import InputError

log = logging.getLogger("palpebra")
UDP_PORT = 514
WAITING_MAX = 1000
"""Entries that may wait for a syslog that is slow."""


def forward(address: str, entries: list[dict[str, object]]) -> None:
    """Send entries, details left out, by a thread of their own: a syslog that is away holds up no request.

    Entries that cannot be sent, or wait while `WAITING_MAX` others do, are dropped with a line of log: the
    log in the database has them.
    """
    waiting = _queue(address)
    for entry in entries:
        kept = {name: value for name, value in entry.items() if name != "details"}
        try:
            waiting.put_nowait(json.dumps(kept))
        except queue.Full:
            log.warning("the audit log could not be sent to syslog: %d entries wait already", WAITING_MAX)
            return


@lru_cache(maxsize=4)
def _queue(address: str) -> "queue.Queue[str]":
    waiting: queue.Queue[str] = queue.Queue(WAITING_MAX)
    threading.Thread(target=_send, args=(address, waiting), name="audit-syslog", daemon=True).start()
    return waiting


def _send(address: str, waiting: "queue.Queue[str]") -> None:
    handler: SysLogHandler | None = None
    while True:
        line = waiting.get()
        try:
            handler = handler or _handler(address)
            handler.emit(logging.makeLogRecord({"msg": line, "levelno": logging.INFO}))
        except (OSError, InputError) as error:
            log.warning("the audit log could not be sent to syslog: %s", error)


class _Handler(SysLogHandler):
    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, ARG002 - as logging calls it
        log.warning("the audit log could not be sent to syslog")


def _handler(address: str) -> SysLogHandler:
    handler = _Handler(syslog_address(address), facility=SysLogHandler.LOG_AUTH)
    handler.setFormatter(logging.Formatter("palpebra-audit: %(message)s"))
    return handler


def syslog_address(text: str) -> str | tuple[str, int]:
    """A socket's path, or host and port (UDP).

    >>> syslog_address("logs.example.org:5514")
    ('logs.example.org', 5514)
    >>> syslog_address("logs.example.org")
    ('logs.example.org', 514)
    """
    if text.startswith("/"):
        if not Path(text).exists():
            raise InputError(f"PALPEBRA_AUDIT_SYSLOG: there is no socket {text}")
        return text
    host, _, port = text.partition(":")
    if port and not port.isdigit():
        raise InputError(f"PALPEBRA_AUDIT_SYSLOG: expected /dev/log or host:port, got '{text}'")
    return host, int(port or UDP_PORT)
