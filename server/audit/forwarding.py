"""Entries of the audit log to syslog, where `PALPEBRA_AUDIT_SYSLOG` names one."""

import json
import logging
import queue
import socket
import ssl
import threading
from functools import lru_cache
from logging.handlers import SysLogHandler
from pathlib import Path

from experiments.errors import InputError
from server.audit.syslog_address import syslog_address

log = logging.getLogger("palpebra")
CONNECT_S = 5.0
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
        except (OSError, ValueError) as error:  # ValueError: what is no name for DNS, or no socket
            log.warning("the audit log could not be sent to syslog: %s", error)


class _Handler(SysLogHandler):
    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, ARG002 - as logging calls it
        log.warning("the audit log could not be sent to syslog")


class _Stream(_Handler):
    """Syslog over TCP (RFC 6587), or TLS with the certificate checked (RFC 5425): lengths before messages."""

    def __init__(self, host: str, port: int, *, tls: bool) -> None:
        self._host, self._port, self._tls = host, port, tls
        self._connection: socket.socket | None = None
        super().__init__((host, port), facility=SysLogHandler.LOG_AUTH, socktype=socket.SOCK_STREAM)

    def createSocket(self) -> None:  # noqa: N802 - as logging calls it
        """Connect; a syslog that is away is asked again with the next entry."""
        connection = socket.create_connection((self._host, self._port), timeout=CONNECT_S)
        if self._tls:
            context = ssl.create_default_context()
            connection = context.wrap_socket(connection, server_hostname=self._host.partition("%")[0])
        self._connection = connection

    def emit(self, record: logging.LogRecord) -> None:
        """Send one message, over a new connection where the last was ended; OSError where that fails too."""
        line = f"<{self.encodePriority(self.facility, 'info')}>{self.format(record)}".encode()
        if self._connection is not None and not _ended(self._connection):
            try:
                self._send(line)
            except OSError:
                log.info("the connection to syslog was lost; the same message is sent over a new one")
            else:
                return
        self._hang_up()
        self.createSocket()
        try:
            self._send(line)
        except OSError:
            self._hang_up()
            raise

    def _send(self, line: bytes) -> None:
        if self._connection is not None:
            self._connection.sendall(b"%d " % len(line) + line)

    def _hang_up(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = None


def _ended(connection: socket.socket) -> bool:
    """Whether the other side has hung up, as one that restarts does: what is sent then is lost, unsaid."""
    connection.settimeout(0)
    try:
        return connection.recv(1) == b""
    except (BlockingIOError, ssl.SSLWantReadError):
        return False
    except OSError:
        return True
    finally:
        connection.settimeout(CONNECT_S)


def _handler(address: str) -> SysLogHandler:
    listening = syslog_address(address)
    handler: SysLogHandler
    if listening.transport in ("tcp", "tls"):
        handler = _Stream(listening.host, listening.port, tls=listening.transport == "tls")
    elif listening.transport == "udp":
        handler = _Handler((listening.host, listening.port), facility=SysLogHandler.LOG_AUTH)
    elif Path(listening.host).exists():
        handler = _Handler(listening.host, facility=SysLogHandler.LOG_AUTH)
    else:
        raise InputError(f"PALPEBRA_AUDIT_SYSLOG: there is no socket {listening.host}")
    handler.setFormatter(logging.Formatter("palpebra-audit: %(message)s"))
    return handler
