"""The file that keeps the secret key in the data folder: for its owner alone, made once for all workers."""

import os
import secrets
from pathlib import Path


def secret_key_path(data_folder: Path) -> Path:
    """Where the key of this data folder is kept."""
    return data_folder / "secret_key"


def kept_key(path: Path) -> bytes:
    """The key of a file; generated with file mode 600 where it is not there yet."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    if not path.is_file():
        put_key(temporary, secrets.token_hex(32).encode("ascii"))
        try:
            # A link fails where another worker was first, so that all of them read one key.
            os.link(temporary, path)
        except FileExistsError:
            pass
        finally:
            temporary.unlink()
    return path.read_bytes().strip()


def put_key(path: Path, key: bytes) -> None:
    """Write a key into a file that is not there yet, with file mode 600."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as stream:
        stream.write(key)
