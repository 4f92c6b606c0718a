"""Entries of the audit log to syslog, where `PALPEBRA_AUDIT_SYSLOG` names one."""

import json
import logging
from functools import lru_cache
from logging.handlers import SysLogHandler
from pathlib import Path

from experiments.errors import InputError

log = logging.getLogger("palpebra")
UDP_PORT = 514


def forward(address: str, entries: list[dict[str, object]]) -> None:
    """Send entries, details left out; a syslog that is away costs one line of log and no request."""
    handler = _handler(address)
    for entry in entries:
        kept = {name: value for name, value in entry.items() if name != "details"}
        handler.emit(logging.makeLogRecord({"msg": json.dumps(kept), "levelno": logging.INFO}))


class _Handler(SysLogHandler):
    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, ARG002 - as logging calls it
        log.warning("the audit log could not be sent to syslog")


@lru_cache(maxsize=4)
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
