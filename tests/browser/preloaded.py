"""Imported by the process that servers are forked from: work that each of them would do again."""

import gc

from server.app import every_route
from tests.browser import forked_server  # noqa: F401 - a forked process looks there for what it is to do

every_route()
# What is there stays: no forked process goes through it again in search of garbage, which would copy it.
gc.collect()
gc.freeze()
