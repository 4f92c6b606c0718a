"""Ports for servers of tests, which nothing else on the machine is given meanwhile."""

import os
import socket
from itertools import count

FIRST, LAST = 20_000, 32_700
"""Below what systems give to outgoing connections: a port from there may be taken before a server, or the one
that is started again after `kill -9`, binds it."""
APART = 97  # ports between those that two processes begin with

_numbers = count(os.getpid() * APART)
_held: list[socket.socket] = []
"""The UDP ports of the numbers drawn, kept until this process ends: another that draws the same number sees
that somebody has it, also in the seconds before a server binds the TCP port and between two of its lives."""


def free_port() -> int:
    """A port nobody listens on, or is given by another process of tests while this one runs."""
    for number in _numbers:
        port = FIRST + number % (LAST - FIRST)
        if _hold(port):
            return port
    raise AssertionError("the numbers do not end")


def _hold(port: int) -> bool:
    """True where the number was nobody's; it then is this process's."""
    held = socket.socket(type=socket.SOCK_DGRAM)
    with socket.socket() as probe:
        try:
            held.bind(("127.0.0.1", port))
            probe.bind(("127.0.0.1", port))
        except OSError:
            held.close()
            return False
    _held.append(held)
    return True
