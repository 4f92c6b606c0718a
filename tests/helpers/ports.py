"""Ports for servers of tests, which nothing else on the machine is given meanwhile."""

import os
import socket
from itertools import count

FIRST, LAST = 20_000, 32_700
"""Below what systems give to outgoing connections: a port from there may be taken before a server, or the one
that is started again after `kill -9`, binds it."""
APART = 97  # ports between those that two processes begin with

_numbers = count(os.getpid() * APART)


def free_port() -> int:
    """A port nobody listens on: another with each call, and other ports in each process of tests."""
    for number in _numbers:
        port = FIRST + number % (LAST - FIRST)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise AssertionError("the numbers do not end")
