"""Where a syslog listens, as `PALPEBRA_AUDIT_SYSLOG` says it."""

import re
from typing import Literal, NamedTuple

from experiments.errors import InputError

USUAL_PORTS = {"udp": 514, "tcp": 601, "tls": 6514}
MAX_PORT = 65_535
_TEXT = re.compile(
    r"((?P<transport>tcp|tls)://)?"
    r"(\[(?P<address>[0-9A-Fa-f:.]+(%\w+)?)\]|(?P<name>[^/:\[\]]+))"
    r"(:(?P<port>\d{0,5}))?"
)
Transport = Literal["socket", "udp", "tcp", "tls"]


class SyslogAddress(NamedTuple):
    """A socket of this machine, by its path as `host`, or a host and a port."""

    transport: Transport
    host: str
    port: int


def syslog_address(text: str) -> SyslogAddress:
    """A socket's path, or host and port.

    Raises
    ------
    InputError
        It is neither.

    Examples
    --------
    >>> syslog_address("logs.example.org:5514")
    SyslogAddress(transport='udp', host='logs.example.org', port=5514)
    >>> syslog_address("tls://[2001:db8::5]")
    SyslogAddress(transport='tls', host='2001:db8::5', port=6514)
    >>> syslog_address("/dev/log")
    SyslogAddress(transport='socket', host='/dev/log', port=0)
    """
    if text.startswith("/"):
        return SyslogAddress("socket", text, 0)
    parts = _TEXT.fullmatch(text)
    transport: Transport = "udp"
    if parts is not None and parts["transport"]:
        transport = "tls" if parts["transport"] == "tls" else "tcp"
    port = int((parts and parts["port"]) or USUAL_PORTS[transport])
    if parts is None or not 0 < port <= MAX_PORT:
        raise InputError(
            "expected /dev/log, host:port (UDP), tcp://host:port or tls://host:port, an IPv6 address as "
            f"[2001:db8::5]:port, got '{text[:100]}'"
        )
    return SyslogAddress(transport, parts["address"] or parts["name"], port)
