"""Entries of the audit log to syslog, where `PALPEBRA_AUDIT_SYSLOG` names one."""

import json
import logging
import queue
import re
import socket
import ssl
import threading
from functools import lru_cache
from logging.handlers import SysLogHandler
from pathlib import Path

from experiments.errors import InputError

log = logging.getLogger("palpebra")
UDP_PORT = 514
TCP_PORTS = {"tcp": 601, "tls": 6514}
HOST_AND_PORT = re.compile(r"(\[(?P<address>[0-9A-Fa-f:.]+(%\w+)?)\]|(?P<name>[^/:\[\]]+))(:(?P<port>\d+))?")
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
        except (OSError, InputError) as error:
            log.warning("the audit log could not be sent to syslog: %s", error)


class _Handler(SysLogHandler):
    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, ARG002 - as logging calls it
        log.warning("the audit log could not be sent to syslog")


class _Stream(_Handler):
    """Syslog over TCP, or TLS with the certificate checked; a message begins with its length (RFC 5425)."""

    def __init__(self, host: str, port: int, *, tls: bool) -> None:
        self._host, self._port, self._tls = host, port, tls
        self._connection: socket.socket | None = None
        super().__init__((host, port), facility=SysLogHandler.LOG_AUTH, socktype=socket.SOCK_STREAM)

    def createSocket(self) -> None:  # noqa: N802 - as logging calls it
        """Connect; a syslog that is away is asked again with the next entry."""
        connection = socket.create_connection((self._host, self._port), timeout=CONNECT_S)
        if self._tls:
            context = ssl.create_default_context()
            connection = context.wrap_socket(connection, server_hostname=self._host)
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
    scheme, _, rest = address.rpartition("://")
    handler: SysLogHandler
    if scheme:
        host, port = _host_and_port(rest, TCP_PORTS[scheme])
        handler = _Stream(host, port, tls=scheme == "tls")
    else:
        handler = _Handler(syslog_address(address), facility=SysLogHandler.LOG_AUTH)
    handler.setFormatter(logging.Formatter("palpebra-audit: %(message)s"))
    return handler


def syslog_address(text: str) -> str | tuple[str, int]:
    """A socket's path, or host and port (UDP).

    >>> syslog_address("logs.example.org:5514")
    ('logs.example.org', 5514)
    >>> syslog_address("logs.example.org")
    ('logs.example.org', 514)
    >>> syslog_address("[2001:db8::5]:5514")
    ('2001:db8::5', 5514)
    """
    if text.startswith("/"):
        if not Path(text).exists():
            raise InputError(f"PALPEBRA_AUDIT_SYSLOG: there is no socket {text}")
        return text
    return _host_and_port(text, UDP_PORT)


def _host_and_port(text: str, usual: int) -> tuple[str, int]:
    parts = HOST_AND_PORT.fullmatch(text)
    if parts is None:
        raise InputError(
            "PALPEBRA_AUDIT_SYSLOG: expected /dev/log, host:port (UDP), tcp://host:port or tls://host:port, "
            f"an IPv6 address as [2001:db8::5]:port, got '{text}'"
        )
    return parts["address"] or parts["name"], int(parts["port"] or usual)
