"""How every command line of the project ends: one clear line for bad input, never a traceback."""

import errno
import sys
from collections.abc import Callable

from experiments.errors import InputError

NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}
"""What a disk says that is full or may not be written to."""


def run_command_line(app: Callable[[], object]) -> None:
    """Call `app`; print an InputError, or that a disk is full, as one line on stderr and exit with code 2."""
    try:
        app()
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.stderr.write("stopped\n")
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(0)
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        where = f"{error.filename}: " if error.filename else ""
        sys.stderr.write(f"error: {where}{error.strerror}; make room and run the same command again\n")
        sys.exit(2)
