"""`palpebra` without any extra, and without what only Unix has, as far as Linux can do without it.

Run as a program with the arguments of `palpebra`. What other packages use of Unix is imported first and
stays.
"""

import asyncio  # noqa: F401 - its Unix part is imported before Unix is gone
import multiprocessing.util  # noqa: F401
import os
import signal
import subprocess  # noqa: F401
import sys
import tempfile  # noqa: F401

import filelock  # noqa: F401
import platformdirs  # noqa: F401
import uvicorn  # noqa: F401

from experiments.command_line import EXTRAS

EXTRA_MODULES = {module for modules in EXTRAS.values() for module in modules}
MODULES = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "uvloop")  # uvloop has no wheel for Windows
CALLS = ("fork", "geteuid", "getpgid", "getuid", "killpg", "mkfifo", "nice", "setpgid", "setsid", "waitid")
SIGNALS = ("SIGCHLD", "SIGCONT", "SIGHUP", "SIGKILL", "SIGSTOP", "SIGUSR1", "SIGUSR2")


def take_unix_away() -> None:
    """Let its modules fail to import, and its calls and signals be missing; so with the extras' modules."""
    sys.modules.update(dict.fromkeys((*MODULES, *EXTRA_MODULES)))  # type: ignore[arg-type]
    for name in CALLS:
        delattr(os, name)
    for name in SIGNALS:
        delattr(signal, name)


if __name__ == "__main__":
    take_unix_away()
    from palpebra.cli import main

    main()
