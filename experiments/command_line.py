"""How every command line of the project ends: one clear line for bad input, never a traceback."""

import sys
from collections.abc import Callable

from experiments.errors import InputError


def run_command_line(app: Callable[[], object]) -> None:
    """Call `app`; print an InputError as one line on stderr and exit with code 2."""
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
