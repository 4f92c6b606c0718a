"""Write the part of one lock file that another lacks.

A package that the whole needs on more systems than the base is in both, at one version.

    python tools/split_locks.py WHOLE BASE REST

WHOLE and BASE come from the same constraints. Fails, and writes nothing, where BASE pins what WHOLE does not.
"""

import re
import sys
from pathlib import Path

ENTRY = re.compile(r"^(?=\S)", re.MULTILINE)
"""Where the pin of a package begins: its hashes follow on indented lines."""


def entries(lock: str) -> list[str]:
    """The pins of a lock file, each with its hashes."""
    return [entry for entry in ENTRY.split(lock) if entry.strip() and not entry.startswith("#")]


def rest(whole: str, base: str) -> str:
    """The pins of `whole` that `base` lacks.

    Raises
    ------
    ValueError
        `base` has a pin that `whole` lacks: installed together they would contradict each other.
    """
    pinned = set(entries(base))
    known = {_version(entry): _hashes(entry) for entry in entries(whole)}
    strangers = sorted(_version(entry) for entry in pinned if known.get(_version(entry)) != _hashes(entry))
    if strangers:
        names = ", ".join(strangers)
        raise ValueError(f"expected every pin and hash of the base in the whole, which lacks {names}")
    return "".join(entry for entry in entries(whole) if entry not in pinned)


def _version(entry: str) -> str:
    """`name==version` of a pin: a package may be asked for on more systems by the whole than by the base."""
    return entry.split()[0]


def _hashes(entry: str) -> list[str]:
    return [word for word in entry.split() if word.startswith("--hash=")]


def main() -> int:
    """Read both locks, write the rest."""
    whole, base, out = (Path(name) for name in sys.argv[1:4])
    try:
        text = rest(whole.read_text(encoding="utf-8"), base.read_text(encoding="utf-8"))
    except ValueError as error:
        print(f"{base}: {error}; resolve both again with `make lock`")
        return 1
    out.write_text(f"# What is installed besides {base.name}.\n{text}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
