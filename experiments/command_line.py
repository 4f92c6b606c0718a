"""How every command line of the project ends: one clear line for bad input, never a traceback."""

import errno
import os
import sys
from collections.abc import Callable
from typing import Any, NoReturn, Protocol, cast

from experiments.errors import InputError, expectation, wrong_value

# Optional packages: which extra brings them, and the line that installs it.

EXTRAS: dict[str, tuple[str, ...]] = {
    "track": ("numba", "cv2"),
    "render": ("numba", "cv2", "skia", "webrtcvad"),
    "deploy": ("psycopg",),
    "parquet": ("fastparquet",),
    "s3": ("boto3",),
    "dask": ("distributed",),
}
"""Extra -> the modules that it brings."""


def install_line(extra: str | None = None) -> str:
    """The command that installs Palpebra, or it with an extra; it comes as a file, not from an index."""
    return f"uv tool install 'FILE.whl[{extra}]'" if extra else "uv tool install FILE.whl"


def missing_extra(module: str) -> str | None:
    """The install line for a module that is not there; None if no extra brings it.

    Parameters
    ----------
    module : str
        Name that could not be imported, such as `cv2` or `numba.core`.

    Returns
    -------
    str or None

    Examples
    --------
    >>> missing_extra("skia")
    "this command needs the extra 'render'; install Palpebra with it: uv tool install 'FILE.whl[render]'"
    >>> missing_extra("antigravity") is None
    True
    """
    top = module.partition(".")[0]
    for extra in ("render", "deploy", "parquet", "s3", "dask"):
        if top in EXTRAS[extra]:
            return f"this command needs the extra '{extra}'; install Palpebra with it: {install_line(extra)}"
    return None


# How a command line ends.

NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}
"""Errors of a disk that is full or not writable."""
STOPPED = 130
"""Exit code after Ctrl-C, which Typer may have turned into it."""


class UsageError(Protocol):
    """What Typer raises for an unknown command or option, or an invalid value."""

    exit_code: int
    ctx: Any
    __cause__: BaseException | None

    def format_message(self) -> str:
        """What is wrong, without the usage."""


def run_privately(app: Callable[..., object]) -> None:
    """As `run_command_line`; files that the app writes are for its own user alone."""
    before = os.umask(0o077)
    try:
        run_command_line(app)
    finally:
        os.umask(before)


def run_command_line(app: Callable[..., object]) -> None:
    """Call a Typer app, and exit with its code.

    Bad input, a wrong call and a full disk are one line on stderr, with exit code 2.
    """
    # Looking for plugins of pydantic reads the metadata of every installed package; there are none.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        code = app(standalone_mode=False)
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(2)
    except ModuleNotFoundError as error:
        line = missing_extra(error.name or "")
        if line is None:
            raise
        sys.stderr.write(f"error: {line}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        code = STOPPED
    except BrokenPipeError:
        sys.exit(0)
    except Exception as error:
        if type(error).__name__ == "Abort":  # from Typer: a question was declined or could not be asked
            sys.stderr.write("stopped: the question was not answered with yes\n")
            sys.exit(1)
        if not hasattr(error, "format_message"):
            _say_disk(error)
        sys.stderr.write(_wrong_call(cast(UsageError, error)))
        sys.exit(2)
    if code == STOPPED:
        sys.stderr.write("stopped\n")
    sys.exit(code if isinstance(code, int) else 0)


def _wrong_call(error: UsageError) -> str:
    message = _refused_option(error) or error.format_message()
    if not message or "\n" in message:  # a command without its subcommand: the help itself
        return message and message + "\n"
    path = error.ctx.command_path if getattr(error, "ctx", None) is not None else ""
    return f"error: {message.rstrip('.')}{f'; see {path} --help' if path else ''}\n"


def _refused_option(error: UsageError) -> str:
    """A value refused for its type or limit, worded like refused declarations; otherwise empty."""
    errors = getattr(error.__cause__, "errors", None)  # pydantic's, where Typer loaded it: it is slow to load
    param = getattr(error, "param", None)
    if errors is None or param is None:
        return ""
    (detail, *_) = errors()
    option = " / ".join(param.opts) if param.param_type_name == "option" else param.human_readable_name
    problem = wrong_value(detail) if expectation(detail) else detail["msg"].removeprefix("Value error, ")
    return f"{option}: {problem.rstrip('.')}"


def _say_disk(error: Exception) -> NoReturn:
    if not isinstance(error, OSError) or error.errno not in NO_ROOM:
        raise error
    where = f"{error.filename}: " if error.filename else ""
    sys.stderr.write(f"error: {where}{error.strerror}; free disk space and run the same command again\n")
    sys.exit(2)
