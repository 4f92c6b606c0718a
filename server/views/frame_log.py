"""The log of drawn frames, packed: differences from entry to entry as numbers of few bytes, in base64.

An entry is a frame's index and its time in ms; times are kept to 0.01 ms. The text form keeps it readable for
backups and either database.
"""

import base64
from collections.abc import Iterable, Iterator

PER_MS = 100
"""Steps of time a millisecond."""
Entry = tuple[int, float]


def packed(log: Iterable[Entry]) -> str:
    """A log as text."""
    out, frame_before, time_before = bytearray(), 0, 0
    for frame, ms in log:
        time = round(ms * PER_MS)
        _add(out, frame - frame_before)
        _add(out, time - time_before)
        frame_before, time_before = frame, time
    return base64.b64encode(out).decode("ascii")


def unpacked(text: str) -> list[Entry]:
    """The log that `packed` made a text of."""
    numbers, entries, frame, time = _numbers(base64.b64decode(text)), [], 0, 0
    for step in numbers:
        frame, time = frame + step, time + next(numbers)
        entries.append((frame, time / PER_MS))
    return entries


def _add(out: bytearray, number: int) -> None:
    """Append a number: its sign in the lowest bit, then seven bits a byte with a bit for `more`."""
    rest = 2 * number if number >= 0 else -2 * number - 1
    while rest > 0x7F:
        out.append(rest & 0x7F | 0x80)
        rest >>= 7
    out.append(rest)


def _numbers(content: bytes) -> Iterator[int]:
    rest, shift = 0, 0
    for byte in content:
        rest |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            yield -(rest + 1) // 2 if rest & 1 else rest // 2
            rest, shift = 0, 0
